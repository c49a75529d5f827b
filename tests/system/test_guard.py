# SPDX-License-Identifier: MIT
"""The laser goes off when goniod dies or hangs with the light on, and `gonio laser off` needs no goniod.

How late OFF comes is the time from the signal to the first OFF on the wire, by goniosim's record of what it heard
(CLOCK_MONOTONIC, as ours). A machine that is busy is late itself: a second thread measures that meanwhile, as the most
that a sleep of 1 ms took too long. The guard, the pty's worker and the simulator wake up once each on that way, so that
three times as much and 10 ms are allowed on top, at most 1 s. The bounds are those of the design, 50 ms after a death and 550 ms after a hang, for every
single one. GONIO_GUARD_DEATHS says how often goniod dies each way: 5, and 250 (1,000 in all) for the long run."""
import ctypes
import json
import os
import pathlib
import random
import signal
import threading
import time

import pytest

from conftest import BUILD, gonio, wait_for

pytestmark = pytest.mark.timed

PLAN = """\
campaign: {
  name = "guarded";
  theta_i_deg = [ 20.0, 30.0, 40.0, 50.0 ];
  theta_r: { from_deg = -70.0; to_deg = 70.0; step_deg = 0.1; };
  dense: { half_width_deg = 1.0; step_deg = 0.1; };
  readings: { count = 2; };
};
"""
OFF = ("l0", "@cob0")
DEATHS = int(os.environ.get("GONIO_GUARD_DEATHS", "5"))
SEED = int(os.environ.get("GONIO_TEST_SEED", "20261126"))
# AddressSanitizer wants to be the first library of all; here it need not.
MISHAP = {"LD_PRELOAD": str(BUILD / "tests" / "libmishap.so"),
          "ASAN_OPTIONS": os.environ.get("ASAN_OPTIONS", "") + ":verify_asan_link_order=0"}


class Metronome:
    """How late this machine is: the longest that a sleep of 1 ms took too long since begin()."""

    def __init__(self):
        self.worst_s = 0.0
        self.going = True
        self.thread = threading.Thread(target=self._beat, daemon=True)
        self.thread.start()

    def _beat(self):
        while self.going:
            before = time.monotonic()
            time.sleep(0.001)
            self.worst_s = max(self.worst_s, time.monotonic() - before - 0.001)

    def begin(self):
        self.worst_s = 0.0

    def excuse_s(self):
        """Guard, simulator and the wire between them, each as late as the worst seen, which was seen with 10 ms."""
        return min(3 * self.worst_s + 0.01, 1.0)

    def end(self):
        self.going = False
        self.thread.join()


@pytest.fixture
def metronome():
    m = Metronome()
    yield m
    m.end()


@pytest.fixture
def sim(start_sim):
    return start_sim("--fast", "--seed", "3", "--set", "laser.warmup_s=0.05", "--set", "laser.temperatures_s=0")


def alive(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def first_off_s(sim, since_ns, patience_s=5.0):
    """Seconds from a moment to the first OFF on the laser's wire."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        for h in sim.control(do="heard")["heard"]:
            if h["t_ns"] >= since_ns and h["text"] in OFF:
                return (h["t_ns"] - since_ns) * 1e-9
        time.sleep(0.002)
    raise AssertionError(f"no OFF within {patience_s} s: {sim.control(do='heard')['heard'][-10:]}")


def emits(sim):
    return sim.control(do="state")["laser"]["emission"]


def measuring(sim, start_daemon, run=None, env=None):
    """A daemon in the middle of a run, with the light on; the run's number."""
    daemon = start_daemon("--config", sim.folder / "goniod.cfg", env=env)
    if run is None:
        run = daemon.submit(PLAN, "guarded.cfg")["run"]
        events = daemon.follow(0)
    else:
        events = daemon.follow()
        assert daemon.gonio("resume", run, "--detach").returncode == 0
    events.until(lambda e: e["event"] == "reading" and e["run"] == run and e["sweep"] >= 1, 60)
    events.close()
    assert emits(sim)
    return daemon, run


def say(what, delays):
    delays = sorted(delays)
    part = {q: delays[min(len(delays) - 1, int(q * len(delays)))] * 1e3 for q in (0.5, 0.95, 0.99)}
    print(f"{what}: {len(delays)} times, OFF after {part[0.5]:.1f} ms (median), {part[0.95]:.1f} ms (95 %), "
          f"{part[0.99]:.1f} ms (99 %), {delays[-1] * 1e3:.1f} ms (most)")


def half_a_command(sim):
    """What was on the wire when it died: the port is the guard's, so that only root can write there too."""
    with open(sim.folder / "laser", "wb", buffering=0) as port:
        port.write(b"p 0.0")


DEATH = {"SIGKILL": signal.SIGKILL, "SIGSEGV": signal.SIGSEGV, "SIGABRT": signal.SIGABRT, "exit": signal.SIGUSR2}


@pytest.mark.parametrize("way", DEATH)
def test_off_follows_every_death_within_50_ms(sim, start_daemon, metronome, way):
    random_ = random.Random(SEED)
    print("seed", SEED)
    run, delays, excess = None, [], []
    for i in range(DEATHS):
        daemon, run = measuring(sim, start_daemon, run, MISHAP)
        time.sleep(random_.random() * 0.15)  # also between a question and its answer
        metronome.begin()
        if i % 4 == 3 and os.geteuid() == 0:
            half_a_command(sim)
        died_ns = time.monotonic_ns()
        os.kill(daemon.pid, DEATH[way])
        delays.append(first_off_s(sim, died_ns))
        excess.append(delays[-1] - min(2 * metronome.worst_s, 1.0))
        daemon.process.wait(10)
        wait_for(lambda: not emits(sim), 5)
    say(way, delays)
    assert max(excess) < 0.050
    wait_for(lambda: daemon.guard_pid() is None)  # it was read back: nothing is left to do


@pytest.mark.parametrize("way", ["SIGSTOP", "loop"])
def test_off_follows_every_hang_within_550_ms(sim, start_daemon, metronome, way):
    """Stopped as a whole; the instrument's thread alone in an endless loop, while the main thread lives."""
    run, delays, excess = None, [], []
    for _ in range(max(1, DEATHS // 5)):
        daemon, run = measuring(sim, start_daemon, run, MISHAP)
        metronome.begin()
        hung_ns = time.monotonic_ns()
        if way == "SIGSTOP":
            os.kill(daemon.pid, signal.SIGSTOP)
        else:
            hang_instrument(daemon.pid)
        delays.append(first_off_s(sim, hung_ns))
        excess.append(delays[-1] - min(2 * metronome.worst_s, 1.0))
        wait_for(lambda: not emits(sim), 5)
        if way == "loop":
            assert daemon.status()["state"] == "running"  # the main thread knows nothing yet
        daemon.end(signal.SIGKILL)
    say(way, delays)
    assert max(excess) < 0.550
    assert max(delays) > 0.3, "a lease is not given up at once"


def hang_instrument(pid):
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        if (task / "comm").read_text() == "instrument\n":
            libc = ctypes.CDLL(None, use_errno=True)
            assert libc.tgkill(pid, int(task.name), int(signal.SIGUSR1)) == 0
            return
    raise AssertionError("no thread 'instrument'")


def test_a_daemon_that_was_stopped_goes_on_and_pauses(sim, start_daemon):
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    run = daemon.submit(PLAN, "guarded.cfg")["run"]
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    os.kill(daemon.pid, signal.SIGSTOP)
    wait_for(lambda: not emits(sim))
    os.kill(daemon.pid, signal.SIGCONT)
    paused = events.until_state(run, "paused")
    assert "guard switched the laser off" in paused["text"] and "0.5 s" in paused["text"], paused
    assert not emits(sim)
    assert daemon.gonio("resume", "--detach").returncode == 0
    events.until_state(run, "running")
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1, 60)  # after dark and beam
    assert emits(sim)


def test_laser_off_switches_off_a_run_which_pauses(sim, start_daemon):
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    run = daemon.submit(PLAN, "guarded.cfg")["run"]
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    done = daemon.gonio("laser", "off")
    assert done.returncode == 0 and "laser off: read back from serial:" in done.stdout, done
    assert not emits(sim)
    paused = events.until_state(run, "paused")
    assert "gonio laser off" in paused["text"], paused


def test_laser_off_of_an_idle_goniod_leaves_it_ready_for_a_run(sim, start_daemon):
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    assert daemon.gonio("laser", "off").returncode == 0
    wait_for(lambda: "ok" == next(d for d in daemon.status()["devices"] if d["name"] == "laser")["link"]
             and "unconfirmed" not in daemon.gonio("status").stdout)
    time.sleep(2.5)  # it looks once a second, and asks for OFF itself
    daemon.submit(PLAN, "guarded.cfg")
    events = daemon.follow(0)
    e = events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1 or e.get("state") == "paused")
    assert e["event"] == "reading", e


def test_laser_off_holds_a_run_that_is_only_preparing(start_sim, start_daemon):
    sim = start_sim("--seed", "3")  # homing takes its time
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    run = daemon.submit(PLAN, "guarded.cfg")["run"]
    events = daemon.follow(0)
    wait_for(lambda: any(a["moving"] for a in sim.control(do="state")["axes"].values()))
    assert daemon.gonio("laser", "off").returncode == 0
    paused = events.until_state(run, "paused")
    assert "gonio laser off" in paused["text"], paused
    assert sim.control(do="state")["laser"]["ons"] == 0


def test_laser_off_works_while_goniod_hangs(sim, start_daemon):
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    daemon.submit(PLAN, "guarded.cfg")
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    os.kill(daemon.pid, signal.SIGSTOP)
    done = daemon.gonio("laser", "off")
    os.kill(daemon.pid, signal.SIGCONT)
    assert done.returncode == 0 and "read back" in done.stdout, done


def test_laser_off_says_so_when_the_laser_ignores_it(sim, start_daemon):
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    daemon.submit(PLAN, "guarded.cfg")
    daemon.follow(0).until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    sim.control(do="set", ignore_off=True)
    done = daemon.gonio("laser", "off")
    assert done.returncode == 1 and "LASER MAY BE ON" in done.stderr and not done.stdout, done
    sim.control(do="set", ignore_off=False)
    wait_for(lambda: not emits(sim))  # it was still being told


def test_laser_off_opens_the_laser_itself_where_there_is_no_guard(sim, tmp_path):
    env = {"XDG_RUNTIME_DIR": str(tmp_path), "GONIO_SOCKET": ""}
    none = gonio("laser", "off", env=env)
    assert none.returncode == 3 and "no guard" in none.stderr and "--bench" in none.stderr, none
    sim.control(do="state")
    before = time.monotonic_ns()
    done = gonio("laser", "off", "--bench", sim.folder / "goniod.cfg", env=env)
    assert done.returncode == 0 and "laser off: read back from serial:" in done.stdout, done
    heard = [h["text"] for h in sim.control(do="heard")["heard"] if h["t_ns"] >= before]
    assert heard[0] == "l0", heard
    assert set(heard) <= {"l0", "@cob0", "l?", "gom?"}, "nothing else is sent"


def test_a_guard_that_dies_is_replaced_and_the_run_pauses(sim, start_daemon):
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    run = daemon.submit(PLAN, "guarded.cfg")["run"]
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    pid = daemon.guard_pid()
    died_ns = time.monotonic_ns()
    os.kill(pid, signal.SIGKILL)
    delay_s = first_off_s(sim, died_ns)
    print(f"a new guard's OFF after {delay_s * 1e3:.0f} ms")
    paused = events.until_state(run, "paused")
    assert "guard process" in paused["text"], paused
    wait_for(lambda: not emits(sim))
    assert daemon.guard_pid() not in (None, pid)
    assert daemon.gonio("resume", "--detach").returncode == 0
    events.until(lambda e: e["event"] == "reading")


def test_when_both_die_the_service_manager_can_switch_off(sim, start_daemon):
    daemon, _ = measuring(sim, start_daemon)
    os.kill(daemon.guard_pid(), signal.SIGSTOP)  # or it would be quicker than the second kill
    guard = daemon.guard_pid()
    daemon.end(signal.SIGKILL)
    os.kill(guard, signal.SIGKILL)
    wait_for(lambda: not alive(guard))
    assert emits(sim)
    done = daemon.gonio("laser", "off", "--bench", sim.folder / "goniod.cfg", "--json")
    assert done.returncode == 0 and json.loads(done.stdout)["laser_off"] is True, done
    assert not emits(sim)


def test_a_signal_to_the_guard_means_off(sim, start_daemon):
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    run = daemon.submit(PLAN, "guarded.cfg")["run"]
    events = daemon.follow(0)
    events.until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    os.kill(daemon.guard_pid(), signal.SIGTERM)
    wait_for(lambda: not emits(sim))
    paused = events.until_state(run, "paused")
    assert "told to end" in paused["text"], paused


def test_off_waits_for_a_laser_that_was_unplugged_when_goniod_died(sim, start_daemon):
    daemon, _ = measuring(sim, start_daemon)
    pid = daemon.guard_pid()
    sim.control(do="unplug", wire="laser")
    daemon.end(signal.SIGKILL)
    assert emits(sim)
    time.sleep(0.7)
    assert alive(pid)
    sim.control(do="plug", wire="laser")
    wait_for(lambda: not emits(sim))
    wait_for(lambda: not alive(pid))


def test_the_next_goniod_takes_over_from_a_guard_that_cannot_end(sim, start_daemon):
    daemon, _ = measuring(sim, start_daemon)
    pid = daemon.guard_pid()
    sim.control(do="set", ignore_off=True)
    daemon.end(signal.SIGKILL)
    time.sleep(0.7)
    assert alive(pid)
    sim.control(do="set", ignore_off=False)
    begun_ns = time.monotonic_ns()
    again = start_daemon("--config", sim.folder / "goniod.cfg")
    assert not alive(pid) and not emits(sim)
    heard = [h["text"] for h in sim.control(do="heard")["heard"] if h["t_ns"] >= begun_ns]
    assert "l0" in heard
    assert again.end() == 0


def test_what_is_left_of_a_command_does_not_swallow_the_first_off(sim, start_daemon):
    """Start-up: OFF comes first, and ends what somebody else began to say."""
    half_a_command(sim)
    begun_ns = time.monotonic_ns()
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    assert daemon.end() == 0
    heard = [h["text"] for h in sim.control(do="heard")["heard"] if h["t_ns"] >= begun_ns]
    assert heard[0] == "p 0.0" and heard[1] == "l0", heard[:4]


def test_the_stop_socket_is_for_user_and_group_only(daemon):
    assert daemon.stop_socket().stat().st_mode & 0o777 == 0o660
