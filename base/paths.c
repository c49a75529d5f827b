// SPDX-License-Identifier: MIT
#include "base/paths.h"

#include <limits.h>
#include <pwd.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/un.h>
#include <unistd.h>

static const char *filled(const char *name)
{
    const char *value = getenv(name);
    return value && *value ? value : NULL;
}

int paths_socket_fits(const char *path, struct gon_error *err)
{
    size_t most = sizeof(((struct sockaddr_un *)NULL)->sun_path) - 1;
    if (!*path)
        return gon_fail(err, GON_E_INPUT, "the socket's path is empty");
    if (strlen(path) > most)
        return gon_fail(
            err, GON_E_INPUT,
            "socket path %s is %zu bytes long, at most %zu fit; choose a shorter one with --socket",
            path, strlen(path), most);
    return GON_OK;
}

int paths_socket(char *ret_path, size_t size, struct gon_error *err)
{
    char path[4096];
    if (filled("GONIO_SOCKET"))
        snprintf(path, sizeof path, "%s", filled("GONIO_SOCKET"));
    else if (filled("XDG_RUNTIME_DIR"))
        snprintf(path, sizeof path, "%s/goniod.sock", filled("XDG_RUNTIME_DIR"));
    else if (geteuid() == 0)
        snprintf(path, sizeof path, "/run/goniod.sock");
    else
        snprintf(path, sizeof path, "/tmp/goniod-%ld/goniod.sock", (long)geteuid());
    int rc = paths_socket_fits(path, err);
    if (rc == 0)
        snprintf(ret_path, size, "%s", path);
    return rc;
}

int paths_guard(const char *socket, char *ret_path, size_t size, struct gon_error *err)
{
    char path[4096];
    const size_t length = strlen(socket);
    const bool ends = length > 5 && strcmp(socket + length - 5, ".sock") == 0;
    snprintf(path, sizeof path, "%.*s-guard.sock", (int)(ends ? length - 5 : length), socket);
    int rc = paths_socket_fits(path, err);
    if (rc == 0)
        snprintf(ret_path, size, "%s", path);
    return rc;
}

void paths_program(const char *name, char *ret_path, size_t size)
{
    static const char *const places[] = {"", "../bin/"};
    char self[PATH_MAX];
    ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    self[n > 0 ? n : 0] = 0;
    char *slash = strrchr(self, '/');
    for (size_t i = 0; slash && i < sizeof places / sizeof places[0]; i++) {
        slash[1] = 0;
        int used = snprintf(ret_path, size, "%s%s%s", self, places[i], name);
        if (used > 0 && (size_t)used < size && access(ret_path, X_OK) == 0)
            return;
    }
    snprintf(ret_path, size, "%s", name);
}

void paths_person(char *ret_name, size_t size)
{
    const struct passwd *user = filled("GONIO_NAME") ? NULL : getpwuid(getuid());
    snprintf(ret_name, size, "%s",
             filled("GONIO_NAME") ? filled("GONIO_NAME") : user ? user->pw_name : "");
}
