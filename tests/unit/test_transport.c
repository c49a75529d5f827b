// SPDX-License-Identifier: MIT
// uses: drivers base
// Links on real ptys and sockets. The shim is linked in, so that libserialport itself opens a pty
// where a test names it in PTYCOMPAT; everywhere else it passes through.
#include "drivers/link.h"
#include "drivers/transport.h"
#include "drivers/transport_port.h"

#include "tests/shim/ptycompat.c"

#include <arpa/inet.h>
#include <grp.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <setjmp.h>
#include <stddef.h>
#include <cmocka.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>

#define LONG_NS CLK_S(20) // for what must not take that long

static int64_t in(int64_t ns)
{
    return clk_now_ns(clk_system()) + ns;
}

// --- link texts ----------------------------------------------------------------------------------

static void links_are_taken_apart(void **state)
{
    struct link l;
    (void)state;
    assert_int_equal(link_parse("serial:/dev/ttyUSB0", LINK_TEXT, &l, NULL), 0);
    assert_true(l.kind == LINK_SERIAL && l.baud == 115200 && l.parity == 'N' && l.stop == 1);
    assert_string_equal(l.place, "/dev/ttyUSB0");
    assert_int_equal(
        link_parse("modbus-rtu:/dev/x?stop=2&baud=9600&parity=O", LINK_MODBUS, &l, NULL), 0);
    assert_true(l.kind == LINK_SERIAL && l.baud == 9600 && l.parity == 'O' && l.stop == 2);
    assert_int_equal(link_parse("modbus-rtu:/dev/x", LINK_MODBUS, &l, NULL), 0);
    assert_true(l.parity == 'E');
    assert_int_equal(link_parse("modbus-tcp:box", LINK_MODBUS, &l, NULL), 0);
    assert_int_equal(l.kind, LINK_TCP);
    assert_string_equal(l.place, "box");
    assert_string_equal(l.port, "502");
    assert_int_equal(link_parse("tcp:[::1]:4001", LINK_TEXT, &l, NULL), 0);
    assert_string_equal(l.place, "::1");
    assert_string_equal(l.port, "4001");
    assert_int_equal(link_parse("usbtmc:1313:80aF", LINK_TEXT, &l, NULL), 0);
    assert_true(l.kind == LINK_USBTMC && l.vendor == 0x1313 && l.product == 0x80af);
    assert_string_equal(l.place, "");
    assert_int_equal(link_parse("usbtmc:1313:8072:P00:1", LINK_TEXT, &l, NULL), 0);
    assert_string_equal(l.place, "P00:1");
    assert_string_equal(link_serial_number(&l), "P00:1");
    assert_int_equal(link_parse("serial:usb-0403:6001:A1:b?baud=9600", LINK_TEXT, &l, NULL), 0);
    assert_true(l.kind == LINK_SERIAL && l.adapter && l.baud == 9600);
    assert_true(l.vendor == 0x0403 && l.product == 0x6001);
    assert_string_equal(l.place, "usb-0403:6001:A1:b");
    assert_string_equal(link_serial_number(&l), "A1:b");
    assert_int_equal(link_parse("modbus-rtu:usb-1A86:7523", LINK_MODBUS, &l, NULL), 0);
    assert_true(l.adapter && l.vendor == 0x1a86 && l.product == 0x7523 && l.parity == 'E');
    assert_string_equal(link_serial_number(&l), "");
    assert_int_equal(link_parse("serial:/dev/serial/by-id/usb-FTDI", LINK_TEXT, &l, NULL), 0);
    assert_false(l.adapter);
}

static void wrong_links_say_what_is_allowed(void **state)
{
    static const struct {
        const char *text;
        enum link_use use;
        const char *said;
    } rows[] = {
        {"", LINK_TEXT, "unknown kind"},
        {"/dev/ttyUSB0", LINK_TEXT, "serial:"},
        {"modbus-rtu:/dev/x", LINK_TEXT, "unknown kind"},
        {"serial:/dev/x", LINK_MODBUS, "modbus-rtu:"},
        {"serial:", LINK_TEXT, "a path"},
        {"serial:/dev/x?baud=9601", LINK_TEXT, "'baud=9601' is not possible; allowed: 1200, 2400"},
        {"serial:/dev/x?baud=", LINK_TEXT, "not possible"},
        {"serial:/dev/x?baud=9600x", LINK_TEXT, "not possible"},
        {"serial:/dev/x?parity=e", LINK_TEXT, "allowed: N, E, O"},
        {"serial:/dev/x?parity=", LINK_TEXT, "allowed: N, E, O"},
        {"serial:/dev/x?stop=3", LINK_TEXT, "allowed: 1, 2"},
        {"serial:/dev/x?speed=9600", LINK_TEXT, "unknown setting 'speed=9600'"},
        {"serial:/dev/x?", LINK_TEXT, "unknown setting ''"},
        {"serial:usb-", LINK_TEXT, "after usb- comes VID:PID or VID:PID:SERIAL"},
        {"serial:usb-FTDI_A1", LINK_TEXT, "four hexadecimal digits each"},
        {"serial:usb-0403:600?baud=9600", LINK_TEXT, "four hexadecimal digits each"},
        {"serial:usb-0403:6001:", LINK_TEXT, "VID:PID:SERIAL"},
        {"serial:usb-0403:6001:A 1", LINK_TEXT, "VID:PID:SERIAL"},
        {"modbus-rtu:usb-0403", LINK_MODBUS, "a path begins with /"},
        {"tcp:host", LINK_TEXT, "HOST:PORT"},
        {"tcp:host:", LINK_TEXT, "HOST:PORT"},
        {"tcp::4001", LINK_TEXT, "HOST:PORT"},
        {"tcp:host:0", LINK_TEXT, "1..65535"},
        {"tcp:host:65536", LINK_TEXT, "1..65535"},
        {"tcp:host:40x", LINK_TEXT, "1..65535"},
        {"tcp:[::1:4001", LINK_TEXT, "HOST:PORT"},
        {"usbtmc:1313:8072", LINK_MODBUS, "unknown kind"},
        {"usb:1313:8072", LINK_TEXT, "tcp:HOST:PORT or usbtmc:VID:PID:SERIAL"},
        {"usbtmc:", LINK_TEXT, "four hexadecimal digits"},
        {"usbtmc:1313", LINK_TEXT, "four hexadecimal digits"},
        {"usbtmc:1313:", LINK_TEXT, "four hexadecimal digits"},
        {"usbtmc:1313:807", LINK_TEXT, "four hexadecimal digits"},
        {"usbtmc:131g:8072", LINK_TEXT, "four hexadecimal digits"},
        {"usbtmc:0x1313:0x8072", LINK_TEXT, "four hexadecimal digits"},
        {"usbtmc:1313:80721", LINK_TEXT, "four hexadecimal digits"},
        {"usbtmc:1313:8072:", LINK_TEXT, "VID:PID:SERIAL"},
        {"usbtmc:1313:8072:P 1", LINK_TEXT, "VID:PID:SERIAL"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct link l = {.baud = 42};
        struct gon_error err = {0};
        assert_int_equal(link_parse(rows[i].text, rows[i].use, &l, &err), GON_E_INPUT);
        if (!strstr(err.text, rows[i].said))
            fail_msg("'%s' said: %s", rows[i].text, err.text);
        assert_int_equal(l.baud, 42);
    }
}

// --- ptys ----------------------------------------------------------------------------------------

struct line {
    int master;
    char slave[64], link[96];
};

static struct line line_new(void)
{
    struct line l;
    l.master = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(l.master >= 0 && grantpt(l.master) == 0 && unlockpt(l.master) == 0);
    assert_int_equal(ptsname_r(l.master, l.slave, sizeof l.slave), 0);
    snprintf(l.link, sizeof l.link, "serial:%s", l.slave);
    return l;
}

static struct transport *open_link(const char *link)
{
    struct transport *t;
    struct gon_error err;
    if (transport_open(link, clk_system(), NULL, &t, &err) < 0)
        fail_msg("%s", err.text);
    return t;
}

static void check_all_bytes_pass(struct transport *t, int other)
{
    uint8_t out[256], there[256], back[256];
    for (int i = 0; i < 256; i++)
        out[i] = (uint8_t)i;
    assert_int_equal(transport_write(t, out, sizeof out, in(LONG_NS), NULL), 0);
    for (size_t have = 0; have < sizeof there;) {
        ssize_t n = read(other, there + have, sizeof there - have);
        assert_true(n > 0);
        have += (size_t)n;
    }
    assert_memory_equal(out, there, sizeof out);
    assert_int_equal(write(other, there, sizeof there), sizeof there);
    for (size_t have = 0; have < sizeof back;) {
        int n = transport_read(t, back + have, sizeof back - have, in(LONG_NS), NULL);
        assert_true(n > 0);
        have += (size_t)n;
    }
    assert_memory_equal(out, back, sizeof out);
    assert_int_equal(transport_stats(t)->bytes_out, 256);
    assert_int_equal(transport_stats(t)->bytes_in, 256);
}

static void check_flags(const struct transport *t)
{
    assert_true(fcntl(transport_fd(t), F_GETFD) & FD_CLOEXEC);
    assert_true(fcntl(transport_fd(t), F_GETFL) & O_NONBLOCK);
}

static void all_bytes_pass_a_pty(void **state)
{
    (void)state;
    struct line l = line_new();
    struct transport *t = open_link(l.link);
    check_all_bytes_pass(t, l.master);
    check_flags(t);
    transport_close(t);
    close(l.master);
}

// A pty drops PARENB, and tcsetattr then fails in the process that comes second.
static void parity_does_not_keep_a_pty_from_opening(void **state)
{
    char link[128];
    (void)state;
    struct line l = line_new();
    snprintf(link, sizeof link, "%s?parity=E&baud=9600&stop=2", l.link);
    for (int i = 0; i < 3; i++) {
        struct termios termios;
        struct transport *t = open_link(link);
        assert_int_equal(tcgetattr(l.master, &termios), 0);
        assert_int_equal(cfgetospeed(&termios), B9600);
        assert_true(termios.c_cflag & CSTOPB);
        transport_close(t);
    }
    close(l.master);
}

static void links_in_the_file_system_are_followed_by_their_text(void **state)
{
    char folder[] = "/tmp/gonio-test-XXXXXX", a[80], b[80], c[80], link[128];
    (void)state;
    struct line l = line_new();
    assert_non_null(mkdtemp(folder));
    snprintf(a, sizeof a, "%s/port", folder);
    snprintf(b, sizeof b, "%s/by-id", folder);
    snprintf(c, sizeof c, "%s/by-id/usb", folder);
    assert_int_equal(symlink(l.slave, a), 0);
    assert_int_equal(mkdir(b, 0700), 0);
    assert_int_equal(symlink("./../by-id/../port", c), 0);
    snprintf(link, sizeof link, "serial:%s", c);
    struct transport *t = open_link(link);
    check_all_bytes_pass(t, l.master);
    transport_close(t);
    unlink(c);
    rmdir(b);
    unlink(a);
    rmdir(folder);
    close(l.master);
}

static void check_refused(const char *link, enum gon_code code, const char *said)
{
    struct transport *t = NULL;
    struct gon_error err = {0};
    int rc = transport_open(link, clk_system(), NULL, &t, &err);
    if (rc != (int)code || !strstr(err.text, said))
        fail_msg("'%s' gave %d: %s", link, rc, err.text);
    assert_null(t);
}

static void what_cannot_be_opened_says_why(void **state)
{
    (void)state;
    check_refused("serial:/dev/no-such-port", GON_E_GONE, "is it plugged in?");
    check_refused("serial:/etc/passwd", GON_E_INPUT, "is not a serial port");
    check_refused("serial:/dev/null", GON_E_INPUT, "is not a serial port");
}

static void the_second_opener_hears_who_has_it(void **state)
{
    char said[64];
    int ready[2], done[2];
    char byte;
    (void)state;
    struct line l = line_new();
    struct transport *t = open_link(l.link);
    snprintf(said, sizeof said, "in use by pid %ld (test_transport)", (long)getpid());
    check_refused(l.link, GON_E_REFUSED, said);
    transport_close(t);

    assert_true(pipe(ready) == 0 && pipe(done) == 0);
    pid_t child = fork();
    if (child == 0) {
        struct transport *mine;
        close(done[1]);
        int rc = transport_open(l.link, clk_system(), NULL, &mine, NULL);
        byte = rc == 0 ? 'y' : 'n';
        if (write(ready[1], &byte, 1) != 1 || read(done[0], &byte, 1) != 0)
            _exit(1);
        _exit(0);
    }
    assert_int_equal(read(ready[0], &byte, 1), 1);
    assert_int_equal(byte, 'y');
    snprintf(said, sizeof said, "in use by pid %ld ", (long)child);
    check_refused(l.link, GON_E_REFUSED, said);
    close(done[1]);
    assert_int_equal(waitpid(child, NULL, 0), child);
    transport_close(open_link(l.link));
    close(ready[0]);
    close(ready[1]);
    close(done[0]);
    close(l.master);
}

static void *let_go_later(void *ctx)
{
    clk_sleep(clk_system(), CLK_MS(30), NULL);
    close(*(int *)ctx);
    return NULL;
}

// Closed, and still locked for a moment, as by somebody who looks into /proc/PID/fd. A busy machine
// may make the moment too long: once in ten it is not.
static void ones_own_lock_is_waited_for(void **state)
{
    (void)state;
    int rc = -1;
    struct line l = line_new();
    for (int k = 0; k < 10 && rc < 0; k++) {
        pthread_t thread;
        struct transport *t = open_link(l.link);
        int copy = dup(transport_fd(t));
        transport_close(t);
        assert_int_equal(pthread_create(&thread, NULL, let_go_later, &copy), 0);
        rc = transport_open(l.link, clk_system(), NULL, &t, NULL);
        pthread_join(thread, NULL);
        if (rc >= 0)
            transport_close(t);
    }
    assert_int_equal(rc, 0);
    close(l.master);
}

// As another user, who may not even open a port in use (TIOCEXCL).
static int open_as_nobody(const char *link, const char *said)
{
    pid_t child = fork();
    int status = -1;
    if (child == 0) {
        struct transport *t = NULL;
        struct gon_error err = {0};
        if (setgroups(0, NULL) || setresgid(65534, 65534, 65534) || setresuid(65534, 65534, 65534))
            _exit(2);
        if (strstr(said, "in use") &&
            (open(strchr(link, ':') + 1, O_RDWR | O_NOCTTY) >= 0 || errno != EBUSY))
            _exit(3);
        int rc = transport_open(link, clk_system(), NULL, &t, &err);
        _exit(rc == GON_E_REFUSED && strstr(err.text, said) ? 0 : 1);
    }
    waitpid(child, &status, 0);
    return status;
}

static void permission_denied_says_which_group_to_join(void **state)
{
    (void)state;
    struct group *group = getgrnam("dialout");
    if (geteuid() != 0 || !group) {
        print_message("needs root and a group dialout\n");
        skip();
    }
    struct line l = line_new();
    assert_int_equal(chown(l.slave, 0, group->gr_gid), 0);
    assert_int_equal(chmod(l.slave, 0660), 0);
    assert_int_equal(
        open_as_nobody(l.link, "join the group 'dialout': sudo usermod -aG dialout nobody"), 0);
    assert_int_equal(chmod(l.slave, 0600), 0);
    assert_int_equal(open_as_nobody(l.link, "permission denied (mode 600"), 0);
    assert_int_equal(chmod(l.slave, 0666), 0);
    struct transport *t = open_link(l.link);
    assert_int_equal(open_as_nobody(l.link, "in use by pid"), 0);
    transport_close(t);
    close(l.master);
}

// --- waiting -------------------------------------------------------------------------------------

// Waits for a byte on fd, then hangs up and requests the token, as far as there is one.
struct helper {
    pthread_t thread;
    int fd;
    bool hang_up;
    struct cancel *cancel;
};

static void *help(void *ctx)
{
    struct helper *h = ctx;
    struct pollfd p = {h->fd, POLLIN, 0};
    poll(&p, 1, 20000);
    if (h->cancel)
        cancel_request(h->cancel);
    if (h->hang_up)
        close(h->fd);
    return NULL;
}

static int64_t cpu_ns(void)
{
    struct timespec ts;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &ts);
    return (int64_t)ts.tv_sec * 1000000000 + ts.tv_nsec;
}

static void check_hang_up(struct transport *t, int other)
{
    struct helper h = {.fd = other, .hang_up = true};
    struct gon_error err;
    char byte;
    assert_int_equal(pthread_create(&h.thread, NULL, help, &h), 0);
    const int64_t start_ns = in(0), cpu_start_ns = cpu_ns();
    assert_int_equal(transport_write(t, "x", 1, in(LONG_NS), NULL), 0);
    assert_int_equal(transport_read(t, &byte, 1, in(LONG_NS), &err), GON_E_GONE);
    assert_true(in(0) - start_ns < LONG_NS / 2);
    assert_true(cpu_ns() - cpu_start_ns < CLK_MS(200)); // it did not spin
    assert_int_equal(transport_read(t, &byte, 1, in(LONG_NS), &err), GON_E_GONE);
    assert_int_equal(transport_write(t, "x", 1, in(LONG_NS), &err), GON_E_GONE);
    assert_int_equal(transport_drain(t, CLK_MS(1), &err), GON_E_GONE);
    pthread_join(h.thread, NULL);
}

static void a_hang_up_is_gone_at_once(void **state)
{
    (void)state;
    struct line l = line_new();
    struct transport *t = open_link(l.link);
    check_hang_up(t, l.master);
    transport_close(t);
}

static void silence_is_a_link_error_at_the_deadline(void **state)
{
    struct gon_error err;
    char byte;
    (void)state;
    struct line l = line_new();
    struct transport *t = open_link(l.link);
    const int64_t deadline_ns = in(CLK_MS(30));
    assert_int_equal(transport_read(t, &byte, 1, deadline_ns, &err), GON_E_LINK);
    assert_true(in(0) >= deadline_ns);
    transport_close(t);
    close(l.master);
}

static void waiting_ends_when_it_is_cancelled(void **state)
{
    struct cancel *cancel = cancel_new();
    struct transport *t;
    struct gon_error err;
    char byte;
    (void)state;
    struct line l = line_new();
    assert_int_equal(transport_open(l.link, clk_system(), cancel, &t, &err), 0);
    struct helper h = {.fd = l.master, .cancel = cancel};
    assert_int_equal(pthread_create(&h.thread, NULL, help, &h), 0);
    assert_int_equal(transport_write(t, "x", 1, in(LONG_NS), NULL), 0);
    const int64_t start_ns = in(0);
    assert_int_equal(transport_read(t, &byte, 1, in(LONG_NS), &err), GON_E_CANCELED);
    assert_true(in(0) - start_ns < LONG_NS / 2);
    pthread_join(h.thread, NULL);
    transport_close(t);
    cancel_free(cancel);
    close(l.master);
}

static void draining_drops_what_is_there(void **state)
{
    char byte;
    (void)state;
    struct line l = line_new();
    struct transport *t = open_link(l.link);
    assert_int_equal(transport_drain(t, 0, NULL), 0);
    assert_int_equal(write(l.master, "stale", 5), 5);
    struct pollfd p = {transport_fd(t), POLLIN, 0};
    assert_int_equal(poll(&p, 1, 20000), 1);
    assert_int_equal(transport_drain(t, CLK_MS(2), NULL), 5);
    assert_int_equal(transport_read(t, &byte, 1, in(0), NULL), GON_E_LINK);
    transport_close(t);
    close(l.master);
}

// --- TCP -----------------------------------------------------------------------------------------

static int listen_on(char link[64], int backlog)
{
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof a;
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_true(fd >= 0 && bind(fd, (struct sockaddr *)&a, sizeof a) == 0 &&
                listen(fd, backlog) == 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&a, &size), 0);
    snprintf(link, 64, "tcp:127.0.0.1:%d", ntohs(a.sin_port));
    return fd;
}

static int option(const struct transport *t, int level, int name)
{
    int value = -1;
    socklen_t size = sizeof value;
    getsockopt(transport_fd(t), level, name, &value, &size);
    return value;
}

static void all_bytes_pass_tcp(void **state)
{
    char link[64];
    (void)state;
    int server = listen_on(link, 4);
    struct transport *t = open_link(link);
    int other = accept(server, NULL, NULL);
    check_all_bytes_pass(t, other);
    check_flags(t);
    assert_int_equal(option(t, IPPROTO_TCP, TCP_NODELAY), 1);
    assert_int_equal(option(t, SOL_SOCKET, SO_KEEPALIVE), 1);
    assert_int_equal(option(t, IPPROTO_TCP, TCP_USER_TIMEOUT), 5000);
    transport_close(t);
    close(other);
    close(server);
}

static void a_closed_connection_is_gone_and_can_be_reopened(void **state)
{
    char link[64];
    (void)state;
    int server = listen_on(link, 4);
    struct transport *t = open_link(link);
    check_hang_up(t, accept(server, NULL, NULL));
    assert_int_equal(transport_reopen(t, NULL), 0);
    assert_int_equal(transport_stats(t)->reopened, 1);
    int other = accept(server, NULL, NULL);
    const struct linger reset = {1, 0}; // RST instead of FIN
    setsockopt(other, SOL_SOCKET, SO_LINGER, &reset, sizeof reset);
    check_hang_up(t, other);
    transport_close(t);
    close(server);
    check_refused(link, GON_E_GONE, "is it switched on and the port right?");
}

static void a_write_that_is_not_taken_ends_at_the_deadline(void **state)
{
    static char much[1 << 23];
    char link[64];
    struct gon_error err;
    (void)state;
    int server = listen_on(link, 4);
    struct transport *t = open_link(link);
    int other = accept(server, NULL, NULL);
    assert_int_equal(transport_write(t, much, sizeof much, in(CLK_MS(50)), &err), GON_E_LINK);
    assert_non_null(strstr(err.text, "of 8388608 bytes in time"));
    assert_true(transport_stats(t)->bytes_out > 0 && transport_stats(t)->bytes_out < sizeof much);
    transport_close(t);
    close(other);
    close(server);
}

// A clock that runs fifty times as fast: two seconds of connecting take 40 ms.
static int64_t hurried_now_ns(const struct clk *clk)
{
    (void)clk;
    return 50 * clk_now_ns(clk_system());
}

static void hurried_sleep_until(struct clk *clk, int64_t t_ns, const struct cancel *cancel)
{
    (void)clk;
    clk_sleep_until(clk_system(), t_ns / 50, cancel);
}

static void a_host_that_does_not_answer_is_given_up(void **state)
{
    const struct clk_ops ops = {hurried_now_ns, hurried_now_ns, hurried_sleep_until};
    struct clk hurried = {&ops};
    struct transport *t[8];
    struct gon_error err;
    char link[64];
    int rc = 0, n = 0;
    (void)state;
    const int64_t start_ns = in(0);
    int server = listen_on(link, 0); // takes one or two, then no more
    while (n < 8 && (rc = transport_open(link, &hurried, NULL, &t[n], &err)) == 0)
        n++;
    assert_int_equal(rc, GON_E_GONE);
    assert_non_null(strstr(err.text, "timed out"));
    assert_true(in(0) - start_ns < CLK_S(3)); // before the kernel's own 5 s
    while (n > 0)
        transport_close(t[--n]);
    close(server);
}

// --- libserialport itself ------------------------------------------------------------------------

static void libserialport_serves_a_port_that_looks_real(void **state)
{
    char folder[] = "/tmp/gonio-test-XXXXXX", by_id[80], link[128], ports[96];
    struct link parsed;
    struct serial_port *p;
    struct gon_error err;
    struct termios termios;
    (void)state;
    struct line l = line_new();
    assert_non_null(mkdtemp(folder));
    snprintf(by_id, sizeof by_id, "%s/usb", folder);
    assert_int_equal(symlink("../../dev/gonio0", by_id), 0); // as udev does
    snprintf(link, sizeof link, "modbus-rtu:%s?baud=19200&parity=E", by_id);
    assert_int_equal(link_parse(link, LINK_MODBUS, &parsed, &err), 0);

    assert_int_equal(transport_serial_open(&parsed, &p, &err), GON_E_GONE); // no such device yet
    snprintf(ports, sizeof ports, "other=/dev/null:gonio0=%s", l.slave);
    setenv("PTYCOMPAT", ports, 1);
    if (transport_serial_open(&parsed, &p, &err) < 0)
        fail_msg("%s", err.text);
    assert_true(transport_serial_by_library(p));
    assert_int_equal(tcgetattr(transport_serial_fd(p), &termios), 0);
    assert_int_equal(cfgetospeed(&termios), B19200);
    assert_true((termios.c_cflag & (PARENB | PARODD | CSTOPB | CSIZE)) == (PARENB | CS8));
    assert_true(fcntl(transport_serial_fd(p), F_GETFD) & FD_CLOEXEC);
    struct serial_port *second;
    assert_int_equal(transport_serial_open(&parsed, &second, &err), GON_E_REFUSED);
    transport_serial_close(p);

    struct transport *t;
    assert_int_equal(transport_open_parsed(&parsed, link, clk_system(), NULL, &t, &err), 0);
    check_all_bytes_pass(t, l.master);
    check_flags(t);
    check_hang_up(t, l.master);
    transport_close(t);
    unsetenv("PTYCOMPAT");
    unlink(by_id);
    rmdir(folder);
}

static void a_plain_pty_is_served_by_termios(void **state)
{
    struct link parsed;
    struct serial_port *p;
    (void)state;
    struct line l = line_new();
    assert_int_equal(link_parse(l.link, LINK_TEXT, &parsed, NULL), 0);
    assert_int_equal(transport_serial_open(&parsed, &p, NULL), 0);
    assert_false(transport_serial_by_library(p));
    transport_serial_close(p);
    close(l.master);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(links_are_taken_apart),
        cmocka_unit_test(wrong_links_say_what_is_allowed),
        cmocka_unit_test(all_bytes_pass_a_pty),
        cmocka_unit_test(parity_does_not_keep_a_pty_from_opening),
        cmocka_unit_test(links_in_the_file_system_are_followed_by_their_text),
        cmocka_unit_test(what_cannot_be_opened_says_why),
        cmocka_unit_test(the_second_opener_hears_who_has_it),
        cmocka_unit_test(ones_own_lock_is_waited_for),
        cmocka_unit_test(permission_denied_says_which_group_to_join),
        cmocka_unit_test(a_hang_up_is_gone_at_once),
        cmocka_unit_test(silence_is_a_link_error_at_the_deadline),
        cmocka_unit_test(waiting_ends_when_it_is_cancelled),
        cmocka_unit_test(draining_drops_what_is_there),
        cmocka_unit_test(all_bytes_pass_tcp),
        cmocka_unit_test(a_closed_connection_is_gone_and_can_be_reopened),
        cmocka_unit_test(a_write_that_is_not_taken_ends_at_the_deadline),
        cmocka_unit_test(a_host_that_does_not_answer_is_given_up),
        cmocka_unit_test(libserialport_serves_a_port_that_looks_real),
        cmocka_unit_test(a_plain_pty_is_served_by_termios),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
