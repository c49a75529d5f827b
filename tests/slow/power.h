// SPDX-License-Identifier: MIT
// A power cut, as a disk may leave it: a file system for SQLite that does what it is told and keeps
// a record, and the files as they may be found after a cut at any place of the record. What was
// synced is there. Of what was written since, each sector of 512 bytes is there or is not,
// whatever came first; a truncation likewise. Names (created, removed) are there up to some one, at
// least up to the last that was synced. Single-threaded; ends the program without memory.
#pragma once
#include <sqlite3.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { POWER_SECTOR = 512, POWER_NAMES = 3, POWER_INODES = 400 };

enum power_kind { POWER_WRITE, POWER_TRUNCATE, POWER_SYNC, POWER_CREATE, POWER_DELETE, POWER_MARK };

struct power_op {
    enum power_kind kind;
    int inode, name;
    int64_t at; // also the size of a truncation, and what a mark means
    int size;
    bool synced; // POWER_DELETE: the folder, too
    unsigned char *data;
};

struct power_bytes {
    unsigned char *data;
    int64_t size, room;
};

static struct {
    sqlite3_vfs vfs, *unix_vfs;
    sqlite3_io_methods methods;
    char path[POWER_NAMES][200]; // the file, its -wal, its -journal
    int inode[POWER_NAMES];      // -1: no such name
    int inodes;
    struct power_op *ops;
    int count, room;
    bool no_full; // PRAGMA synchronous = FULL is not heard
    bool no_sync; // nothing is ever synced, though the disk says so
} power;

struct power_file {
    sqlite3_file base;
    int inode; // -1: of no interest
    sqlite3_file *real;
};

static inline void *power_must(void *memory)
{
    if (!memory)
        abort();
    return memory;
}

static inline struct power_op *power_add(enum power_kind kind, int inode)
{
    if (power.count == power.room) {
        power.room = 2 * power.room + 1024;
        power.ops = power_must(realloc(power.ops, (size_t)power.room * sizeof *power.ops));
    }
    struct power_op *op = &power.ops[power.count++];
    *op = (struct power_op){.kind = kind, .inode = inode};
    return op;
}

static inline void power_mark(int64_t meaning)
{
    power_add(POWER_MARK, -1)->at = meaning;
}

// --- the file system -----------------------------------------------------------------------------

static inline struct power_file *power_of(sqlite3_file *file)
{
    return (struct power_file *)file;
}

#define POWER_PASS(name, args, call)                                                               \
    static inline int power_##name args                                                            \
    {                                                                                              \
        sqlite3_file *real = power_of(file)->real;                                                 \
        return real->pMethods->call;                                                               \
    }
POWER_PASS(read, (sqlite3_file * file, void *data, int size, sqlite3_int64 at),
           xRead(real, data, size, at))
POWER_PASS(size, (sqlite3_file * file, sqlite3_int64 *size), xFileSize(real, size))
POWER_PASS(lock, (sqlite3_file * file, int level), xLock(real, level))
POWER_PASS(unlock, (sqlite3_file * file, int level), xUnlock(real, level))
POWER_PASS(reserved, (sqlite3_file * file, int *ret), xCheckReservedLock(real, ret))
POWER_PASS(sector, (sqlite3_file * file), xSectorSize(real))
POWER_PASS(device, (sqlite3_file * file), xDeviceCharacteristics(real))
POWER_PASS(shm_map, (sqlite3_file * file, int page, int size, int extend, void volatile **ret),
           xShmMap(real, page, size, extend, ret))
POWER_PASS(shm_lock, (sqlite3_file * file, int offset, int n, int flags),
           xShmLock(real, offset, n, flags))
POWER_PASS(shm_unmap, (sqlite3_file * file, int remove), xShmUnmap(real, remove))

static inline void power_barrier(sqlite3_file *file)
{
    sqlite3_file *real = power_of(file)->real;
    real->pMethods->xShmBarrier(real);
}

static inline int power_close(sqlite3_file *file)
{
    sqlite3_file *real = power_of(file)->real;
    int rc = real->pMethods->xClose(real);
    free(real);
    return rc;
}

static inline int power_write(sqlite3_file *file, const void *data, int size, sqlite3_int64 at)
{
    sqlite3_file *real = power_of(file)->real;
    if (power_of(file)->inode >= 0) {
        struct power_op *op = power_add(POWER_WRITE, power_of(file)->inode);
        op->at = at;
        op->size = size;
        op->data = power_must(malloc((size_t)size));
        memcpy(op->data, data, (size_t)size);
    }
    return real->pMethods->xWrite(real, data, size, at);
}

static inline int power_truncate(sqlite3_file *file, sqlite3_int64 size)
{
    sqlite3_file *real = power_of(file)->real;
    if (power_of(file)->inode >= 0)
        power_add(POWER_TRUNCATE, power_of(file)->inode)->at = size;
    return real->pMethods->xTruncate(real, size);
}

// The real one is not asked: the record is what counts.
static inline int power_sync(sqlite3_file *file, int flags)
{
    (void)flags;
    if (power_of(file)->inode >= 0 && !power.no_sync)
        power_add(POWER_SYNC, power_of(file)->inode);
    return SQLITE_OK;
}

static inline int power_control(sqlite3_file *file, int op, void *arg)
{
    sqlite3_file *real = power_of(file)->real;
    char **pragma = arg;
    if (op == SQLITE_FCNTL_PRAGMA && power.no_full && !strcmp(pragma[1], "synchronous") &&
        pragma[2] && !strcmp(pragma[2], "FULL"))
        return SQLITE_OK; // taken for done
    return real->pMethods->xFileControl(real, op, arg);
}

static inline int power_name(const char *path)
{
    for (int i = 0; i < POWER_NAMES; i++)
        if (path && !strcmp(path, power.path[i]))
            return i;
    return -1;
}

static inline int power_open(sqlite3_vfs *vfs, const char *path, sqlite3_file *file, int flags,
                             int *ret_flags)
{
    (void)vfs;
    struct power_file *f = power_of(file);
    const int name = power_name(path);
    *f = (struct power_file){.inode = -1};
    f->real = power_must(calloc(1, (size_t)power.unix_vfs->szOsFile));
    int rc = power.unix_vfs->xOpen(power.unix_vfs, path, f->real, flags, ret_flags);
    if (rc != SQLITE_OK) {
        free(f->real);
        return rc;
    }
    if (name >= 0 && power.inode[name] < 0) {
        if (power.inodes == POWER_INODES)
            abort();
        power.inode[name] = power.inodes++;
        power_add(POWER_CREATE, power.inode[name])->name = name;
    }
    f->inode = name >= 0 ? power.inode[name] : -1;
    f->base.pMethods = &power.methods;
    return SQLITE_OK;
}

static inline int power_delete(sqlite3_vfs *vfs, const char *path, int sync_folder)
{
    (void)vfs;
    const int name = power_name(path);
    if (name >= 0 && power.inode[name] >= 0) {
        struct power_op *op = power_add(POWER_DELETE, power.inode[name]);
        op->name = name;
        op->synced = sync_folder;
        power.inode[name] = -1;
    }
    return power.unix_vfs->xDelete(power.unix_vfs, path, sync_folder);
}

// Begins a record for a file that is there, closed and safe; SQLite uses this file system for all
// until power_end.
static inline void power_begin(const char *path, bool no_full, bool no_sync)
{
    static const char *const suffix[POWER_NAMES] = {"", "-wal", "-journal"};
    power.unix_vfs = sqlite3_vfs_find("unix");
    power.vfs = *power.unix_vfs;
    power.vfs.zName = "power";
    power.vfs.szOsFile = sizeof(struct power_file);
    power.vfs.xOpen = power_open;
    power.vfs.xDelete = power_delete;
    power.methods = (sqlite3_io_methods){2,
                                         power_close,
                                         power_read,
                                         power_write,
                                         power_truncate,
                                         power_sync,
                                         power_size,
                                         power_lock,
                                         power_unlock,
                                         power_reserved,
                                         power_control,
                                         power_sector,
                                         power_device,
                                         power_shm_map,
                                         power_shm_lock,
                                         power_barrier,
                                         power_shm_unmap,
                                         NULL,
                                         NULL};
    for (int i = 0; i < POWER_NAMES; i++) {
        snprintf(power.path[i], sizeof power.path[i], "%s%s", path, suffix[i]);
        power.inode[i] = i ? -1 : 0;
    }
    power.inodes = 1;
    power.no_full = no_full;
    power.no_sync = no_sync;
    sqlite3_vfs_register(&power.vfs, 1);
}

static inline void power_end(void)
{
    sqlite3_vfs_register(power.unix_vfs, 1);
    sqlite3_vfs_unregister(&power.vfs);
}

static inline void power_forget(void)
{
    for (int i = 0; i < power.count; i++)
        free(power.ops[i].data);
    free(power.ops);
    power.ops = NULL;
    power.count = power.room = 0;
}

// --- what a cut leaves ---------------------------------------------------------------------------

// The disk as far as it is certain at a place of the record, and what is under way since.
struct power_disk {
    struct power_bytes file[POWER_INODES];
    int entry[POWER_NAMES]; // inode, or -1
    int at;                 // operations looked at
    int *pending, pending_count, pending_room;
};

static inline void power_resize(struct power_bytes *b, int64_t size)
{
    if (size > b->room) {
        b->room = 2 * size;
        b->data = power_must(realloc(b->data, (size_t)b->room));
    }
    if (size > b->size)
        memset(b->data + b->size, 0, (size_t)(size - b->size));
    b->size = size;
}

static inline void power_put(struct power_bytes *b, int64_t at, const unsigned char *data,
                             int64_t n)
{
    if (at + n > b->size)
        power_resize(b, at + n);
    memcpy(b->data + at, data, (size_t)n);
}

static inline void power_apply(struct power_disk *d, const struct power_op *op)
{
    switch (op->kind) {
    case POWER_WRITE: power_put(&d->file[op->inode], op->at, op->data, op->size); break;
    case POWER_TRUNCATE: power_resize(&d->file[op->inode], op->at); break;
    case POWER_CREATE: d->entry[op->name] = op->inode; break;
    case POWER_DELETE: d->entry[op->name] = -1; break;
    default: break;
    }
}

static inline bool power_is_name(const struct power_op *op)
{
    return op->kind == POWER_CREATE || op->kind == POWER_DELETE;
}

// Makes certain what is under way of an inode, or all names.
static inline void power_settle(struct power_disk *d, int inode, bool names)
{
    int kept = 0;
    for (int i = 0; i < d->pending_count; i++) {
        const struct power_op *op = &power.ops[d->pending[i]];
        if (power_is_name(op) ? names : op->inode == inode)
            power_apply(d, op);
        else
            d->pending[kept++] = d->pending[i];
    }
    d->pending_count = kept;
}

static inline bool power_is_new(const struct power_disk *d, int inode)
{
    for (int i = 0; i < d->pending_count; i++)
        if (power.ops[d->pending[i]].kind == POWER_CREATE &&
            power.ops[d->pending[i]].inode == inode)
            return true;
    return false;
}

static inline void power_advance(struct power_disk *d, int to)
{
    for (; d->at < to; d->at++) {
        const struct power_op *op = &power.ops[d->at];
        if (op->kind == POWER_SYNC) {
            power_settle(d, op->inode, power_is_new(d, op->inode)); // with its folder
        } else if (op->kind != POWER_MARK) {
            if (d->pending_count == d->pending_room) {
                d->pending_room = 2 * d->pending_room + 64;
                d->pending =
                    power_must(realloc(d->pending, (size_t)d->pending_room * sizeof *d->pending));
            }
            d->pending[d->pending_count++] = d->at;
            if (op->synced)
                power_settle(d, -1, true);
        }
    }
}

static inline void power_clear(struct power_disk *d)
{
    for (int i = 0; i < POWER_INODES; i++)
        free(d->file[i].data);
    free(d->pending);
    *d = (struct power_disk){.entry = {0, -1, -1}};
}
