// SPDX-License-Identifier: MIT
// uses: drivers sim model base
// Is a wrong value ever accepted from a bad link? In virtual time: the drivers and the unmodified
// libmodbus on lines where one answer in two hundred is lost, up to 3 s late, doubled up to 3 s
// later, cut at its end or its beginning, split into its bytes, merged with the one before, wrapped
// in garbage or changed; and the USBTMC driver with a device that fails in as many ways of its own
// (links_usbtmc.h). No answer overtakes an earlier one.
//
//   check_links [-s SEED] [-n READS]
//
// Run it where configs/ is. Wrong is a value that the register or quantity did not hold at any time
// between the call and its return: a register tells which request it answers, a quantity is another
// one each millisecond. Quiet times are those of a profile whose largest latency is 3.1 s. Each
// policy is measured twice: as it is (0 wrong of 600,000 must come out), and by a client that asks
// and takes what comes, without the protections (which must give wrong values: so the faults bite).
#include "tests/slow/links_modbus.h"
#include "tests/slow/links_serial.h"
#include "tests/slow/links_usbtmc.h"

#include <getopt.h>
#include <inttypes.h>
#include <stdio.h>

enum { READS = 600000, BARE_READS = 60000, LIMIT_READS = 200000, SEED = 20261126 };

static int failed;

static void report(const char *policy, struct links_tally t, struct links_tally bare)
{
    const bool good =
        t.wrong == 0 && t.answered > t.reads / 100 * 99 && bare.wrong > 0 && t.faults > 0;
    printf("%-22s %7d %7" PRIu64 " %9d %8d %6d %9.0f %10d %6d  %s\n", policy, t.reads, t.faults,
           t.answered, t.refused, t.wrong, t.line_s, bare.answered, bare.wrong,
           good ? "ok" : "FAILED");
    fflush(stdout);
    failed += !good;
}

static void report_serial(struct links_serial s, int reads, int seed)
{
    report(s.policy.name, links_measure_serial(&s, reads, seed),
           links_measure_bare_serial(&s, BARE_READS, seed));
    free(s.policy.profile);
}

static void report_usb(struct links_policy p, int reads, int seed)
{
    report(p.name, links_measure_usb(&p, reads, seed),
           links_measure_bare_usb(&p, BARE_READS, seed));
    free(p.profile);
}

// What a line without a checksum cannot show stays within the bounds of the profile; and what the
// two forms of question, the time stamp and the echo are for.
static void report_limits(int seed)
{
    const struct links_serial digits = links_digits(), alike = links_alike();
    const struct links_tally t = links_measure_serial(&digits, LIMIT_READS, seed);
    const struct links_tally one = links_measure_serial(&alike, LIMIT_READS, seed);
    printf("Not in the table: no line without a checksum shows that a number lost or got a digit, "
           "a sign or a blank.\n"
           "%d reads with such faults: %" PRIu64 " faults, %d wrong accepted, %d beyond the "
           "profile's bounds  %s\n"
           "%d reads by one question, without echo, time stamp and checksum: %d wrong  %s\n",
           t.reads, t.faults, t.wrong, t.beyond, t.beyond ? "FAILED" : "ok", one.reads, one.wrong,
           one.wrong ? "as expected" : "FAILED");
    failed += t.beyond > 0;
    failed += one.wrong == 0;
    free(digits.policy.profile);
    free(alike.policy.profile);
}

int main(int argc, char **argv)
{
    int seed = SEED, reads = READS;
    for (int c; (c = getopt(argc, argv, "s:n:")) != -1;) {
        if (c == '?')
            return 2;
        *(c == 's' ? &seed : &reads) = atoi(optarg);
    }
    printf("links: seed %d, one fault in %d answers, up to %.0f s late\n"
           "%-22s %7s %7s %9s %8s %6s %9s %10s %6s\n",
           seed, LINKS_ONE_IN, (double)LINKS_LATE_NS * 1e-9, "", "reads", "faults", "answered",
           "refused", "wrong", "s on line", "bare: ans.", "wrong");
    report("modbus-rtu", links_measure_bus(false, reads, seed),
           links_measure_bare_bus(false, BARE_READS, seed));
    report("modbus-tcp", links_measure_bus(true, reads, seed),
           links_measure_bare_bus(true, BARE_READS, seed));
    report_serial(links_summed(), reads, seed);
    report_serial(links_plain(), reads, seed);
    report_serial(links_stamped(), reads, seed);
    report_serial(links_echoed(), reads, seed);
    report_usb(links_meter(), reads, seed);
    report_usb(links_lockin(), reads, seed);
    report_limits(seed);
    printf("links: %s\n", failed ? "FAILED" : "ok, no wrong value");
    return failed != 0;
}
