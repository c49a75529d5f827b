// SPDX-License-Identifier: MIT
#include "sim/actor_served.h"
#include "base/clk.h"
#include "sim/actor_control.h"
#include "sim/actor_message.h"
#include "sim/actor_registers.h"

#include <stdlib.h>
#include <string.h>

enum { PTY, TCP, PORTS };

struct actor_served {
    struct served served; // first
    struct actor_spec spec;
    struct actor actor;
    struct actor_message message[PORTS];
    struct sim_modbus modbus[PORTS];
    struct wire wire[PORTS];
    char name[PORTS][PROFILE_NAME + 8];
};

static bool is_modbus(const struct actor_served *a)
{
    return a->spec.profile->protocol == PROFILE_MODBUS;
}

static struct port *port(struct actor_served *a, int i)
{
    if (!is_modbus(a)) {
        actor_message_init(&a->message[i], &a->actor);
        return &a->message[i].port;
    }
    int64_t reply_ns = (int64_t)(a->spec.profile->simulate.reply_ms * 1e6);
    sim_modbus_init(&a->modbus[i], i == TCP, 0, reply_ns);
    sim_modbus_add(&a->modbus[i], actor_registers_unit(&a->actor, a->spec.unit));
    return &a->modbus[i].port;
}

static int open_wires(struct served *s, const struct rundir *dir, struct gon_error *err)
{
    struct actor_served *a = (struct actor_served *)s;
    char path[RUNDIR_FILE];
    rundir_path(dir, a->name[PTY], path, sizeof path);
    wire_pty_init(&a->wire[PTY], a->name[PTY], port(a, PTY), path);
    wire_tcp_init(&a->wire[TCP], a->name[TCP], port(a, TCP));
    a->wire[PTY].enforce = a->spec.enforce;
    a->wire[PTY].bits = is_modbus(a) ? 11 : 10; // 8E1; 8N1
    for (int i = 0; i < PORTS; i++)
        if (wire_plug(&a->wire[i], err))
            return err->code;
    return 0;
}

static void turn(struct served *s)
{
    struct actor_served *a = (struct actor_served *)s;
    a->modbus[PTY].gap_ns = wire_char_ns(&a->wire[PTY]) * 7 / 2; // 3.5 characters
}

static char *control(struct served *s, const char *line, int64_t t_ns)
{
    struct actor_served *a = (struct actor_served *)s;
    return actor_control_answer(&a->actor, a->wire, PORTS, line, t_ns);
}

static void free_all(struct served *s)
{
    free(s);
}

int actor_served_new(const struct actor_spec *spec, struct served **ret_served,
                     struct gon_error *err)
{
    static const struct served_ops ops = {open_wires, turn, control, free_all};
    struct actor_served *a = calloc(1, sizeof *a);
    if (!a)
        return gon_fail(err, GON_E_SYSTEM, "out of memory");
    a->served = (struct served){&ops, PORTS, a->wire};
    a->spec = *spec;
    snprintf(a->name[PTY], sizeof a->name[PTY], "%s", spec->profile->name);
    snprintf(a->name[TCP], sizeof a->name[TCP], "%s-tcp", spec->profile->name);
    int rc = actor_init(&a->actor, spec->profile, clk_now_ns(clk_system()), err);
    if (rc)
        free(a);
    else
        *ret_served = &a->served;
    return rc;
}

// "?baud=9600" of the profile's own example.
static const char *settings(const struct profile *p)
{
    bool line = strncmp(p->link, "serial:", 7) == 0 || strncmp(p->link, "modbus-rtu:", 11) == 0;
    return line ? p->link + strcspn(p->link, "?") : "";
}

void actor_served_links(const struct served *s, FILE *out)
{
    const struct actor_served *a = (const struct actor_served *)s;
    const char *pty = a->wire[PTY].address, *tcp = a->wire[TCP].address;
    const char *line = settings(a->spec.profile);
    if (is_modbus(a))
        fprintf(out, "modbus-rtu:%s%s (unit %d)\nmodbus-tcp:%s (unit %d)\n", pty, line,
                a->spec.unit, tcp, a->spec.unit);
    else
        fprintf(out, "serial:%s%s\ntcp:%s\n", pty, line, tcp);
}
