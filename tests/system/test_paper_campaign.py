# SPDX-License-Identifier: MIT
"""The paper's whole plan, over Modbus RTU + serial with the lines' speed enforced and over TCP, from plan to fit;
and smaller plans with other seeds and samples. What is recovered must lie within 3 reported standard uncertainties
of the simulated truth. The simulator's noise comes as real time does, so a fixed seed does not fix it: of 3 quantities
one in 120 campaigns of a correct program lies beyond 3. Such a campaign (none beyond 5) is measured once more with
another seed and must then hold: 5 campaigns fail by chance once in 3000 runs."""
import json
import math

import pytest

from conftest import ROOT

PAPER = (ROOT / "configs" / "paper.cfg").read_text()
SERIAL = ("--fast", "--set", "wires.speed=true", "--set", "wires.axes_baud=230400",
          "--set", "wires.detector_baud=230400")


def fresnel_mean(n, k, beta_deg):
    """(|rs|^2 + |rp|^2)/2 by complex arithmetic: independent of the product's real form."""
    c = math.cos(math.radians(beta_deg))
    s2 = 1 - c * c
    eps = complex(n, k) ** 2
    q = (eps - s2) ** 0.5
    return (abs((c - q) / (c + q)) ** 2 + abs((eps * c - q) / (eps * c + q)) ** 2) / 2


def worst_deviation(fit, truth):
    """Of sigma, kd and ks R(45), in standard uncertainties."""
    p = fit["params"]
    expected = {"sigma": (p["sigma"], truth["sigma"]), "kd": (p["kd"], truth["kd"]),
                "ks_r45": (fit["derived"]["ks_r45"], truth["ks"] * fresnel_mean(truth["n"], truth["k"], 45))}
    z = {}
    for name, (got, true) in expected.items():
        assert got["u"] > 0 and got["u"] < 0.05 * true, (name, got)
        z[name] = (got["value"] - true) / got["u"]
    print("standard uncertainties from the truth:", z)
    assert max(map(abs, z.values())) <= 5, (z, p)
    return max(map(abs, z.values()))


def recover(check, start_sim, start_daemon, config, bench, *sim_args, seed):
    """Measures, lets the caller check the run, and compares with the truth; once more beyond 3."""
    for again in (0, 1000):
        measured = measure(start_sim, start_daemon, config, bench, *sim_args, seed=seed + again)
        check(*measured)
        if worst_deviation(measured[3], measured[2]) <= 3:
            return
    pytest.fail("two campaigns lie beyond 3 standard uncertainties")


def measure(start_sim, start_daemon, config, bench, *sim_args, seed):
    sim = start_sim(*sim_args, "--seed", seed, folder=config.parent / f"bench{seed}")
    truth = sim.control(do="truth")["sample"]
    daemon = start_daemon("--config", sim.folder / bench, folder=config.parent / f"d{seed}")
    done = daemon.gonio("run", config, "--json", patience_s=85)
    assert done.returncode == 0, (done.stderr[-2000:], daemon.errors()[-2000:])
    last = json.loads(done.stdout.splitlines()[-1])
    run = json.loads(daemon.gonio("list", "--json").stdout)[0]
    fit = json.loads(daemon.gonio("fit", run["id"], "--json").stdout)
    state = sim.control(do="state")
    assert not state["laser"]["emission"], "the laser is off after the campaign"
    return daemon, run, truth, fit, last


@pytest.mark.parametrize("bench, args, seed", [("goniod.cfg", SERIAL, 11), ("goniod-tcp.cfg", ("--fast",), 12)])
def test_the_papers_plan_runs_to_its_end_and_recovers_the_sample(start_sim, start_daemon, tmp_path, bench, args,
                                                                 seed):
    config = tmp_path / "paper.cfg"
    config.write_text(PAPER.replace("count = 4", "count = 2"))  # the directions are the paper's; half the samples

    def check(daemon, run, truth, fit, last):
        assert run["state"] == "done"
        shown = json.loads(daemon.gonio("show", run["id"], "--json").stdout)
        assert fit["points"] == 850  # ten sweeps of 69 + 16 directions
        assert shown["fit"]["points"] == 850  # and the daemon's own, after the last sweep

    recover(check, start_sim, start_daemon, config, bench, *args, seed=seed)


SMALL_PLAN = """\
campaign: {
  name = "seed";
  theta_i_deg = [ 10.0, 30.0, 55.0 ];
  theta_r: { from_deg = -60.0; to_deg = 80.0; step_deg = 5.0; };
  dense: { half_width_deg = 2.0; step_deg = 1.0; };
};
"""


@pytest.mark.parametrize("seed, sample", [
    (21, {}),
    (22, {"n": 1.3, "k": 7.5, "sigma": 0.12, "ks": 1.0, "kd": 0.01}),
    (23, {"n": 2.0, "k": 0.2, "sigma": 0.25, "ks": 0.7, "kd": 0.09}),
])
def test_other_seeds_and_samples_are_recovered(start_sim, start_daemon, tmp_path, seed, sample):
    config = tmp_path / "seed.cfg"
    config.write_text(SMALL_PLAN)
    sets = [w for name, value in sample.items() for w in ("--set", f"sample.{name}={value}")]

    def check(daemon, run, truth, fit, last):
        assert run["state"] == "done"

    recover(check, start_sim, start_daemon, config, "goniod-tcp.cfg", "--fast", *sets, seed=seed)
