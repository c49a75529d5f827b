# SPDX-License-Identifier: MIT
"""Whole campaigns whose laser, detector and axes the simulator makes from the shipped profiles (sim.cfg: laser.profile,
detector.profile, axes.profile) in place of its own models: what is recovered lies within its uncertainty of the truth.
Judged as in test_paper_campaign.py: beyond 3 standard uncertainties the campaign is made once more, by which 4
campaigns fail by chance once in 3600 runs. Where there is no monitor the laser does not drift, as its drift is then in
no uncertainty of a reading."""
import re
import shutil

import pytest

from conftest import QUICK_LASER, ROOT, gonio, wait_for
from test_paper_campaign import SMALL_PLAN, recover

STEADY = ("--set", "laser.drift_rms=0")
FEW = SMALL_PLAN.replace("step_deg = 5.0", "step_deg = 20.0").replace("10.0, 30.0, 55.0", "10.0, 50.0").replace(
    "dense:", "readings: { count = 2; };\n  dense:")

BENCHES = [
    ("sr860", "coherent-obis", "", SMALL_PLAN, ()),
    ("sr830", "cobolt-05", "oriental-az", SMALL_PLAN, ()),
    ("keithley-6485", "laser-quantum", "leadshine-pr", FEW, STEADY),
    ("thorlabs-pm100", "", "", FEW, STEADY),
]


def made_from(detector="", laser="", axes=""):
    return [w for part, name in (("detector", detector), ("laser", laser), ("axes", axes)) if name
            for w in ("--set", f"{part}.profile={name}")]


@pytest.mark.parametrize("detector, laser, axes, plan, sets", BENCHES, ids=["-".join(b[:3]) for b in BENCHES])
def test_shipped_instruments_measure_a_campaign(start_sim, start_daemon, tmp_path, detector, laser, axes, plan, sets):
    config = tmp_path / "seed.cfg"
    config.write_text(plan)

    def check(daemon, run, truth, fit, last):
        assert run["state"] == "done"
        bench = next(tmp_path.glob("bench*/goniod.cfg")).read_text()
        for name in filter(None, (detector, laser, axes)):
            assert f"/{name}.cfg" in bench
        if detector == "keithley-6485":  # a current, in its own unit
            assert re.search(r"^detector +full scale \S+ A, last \S+ A, ", daemon.gonio("status").stdout, re.M)

    recover(check, start_sim, start_daemon, config, "goniod.cfg", "--fast", *QUICK_LASER, *sets,
            *made_from(detector, laser, axes), seed=31)


def test_a_strong_signal_is_over_and_its_flag_follows(start_sim):
    sim = start_sim("--fast", *made_from("keithley-6485"))

    def values(**changes):
        if changes:
            assert sim.control(do="set", part="detector", values=changes)["ok"]
        return sim.control(do="values", part="detector")["values"]

    assert values(full_scale=0.02)["status"] == 0
    assert sim.control(do="set", saturate=True)["ok"]
    wait_for(lambda: values()["status"] == 1)
    assert values()["current_a"] is None  # over
    assert sim.control(do="set", saturate=False)["ok"]
    wait_for(lambda: values()["status"] == 0)
    values(full_scale=2e-8)
    # the dark's 4 nA; noise is 0.3 nA, so 2 nA are 7 times that
    wait_for(lambda: abs((values()["current_a"] or 1) - 4e-9) < 2e-9)
    assert values()["status"] == 0


def test_a_lasers_light_is_its_profiles(start_sim):
    sim = start_sim("--fast", *made_from(laser="laser-quantum"))

    def laser():
        return sim.control(do="state")["laser"]

    def told(**changes):
        assert sim.control(do="set", part="laser", values=changes)["ok"]

    told(setpoint_w=0.06, enabled="ENABLED")
    wait_for(lambda: sim.control(do="values", part="laser")["values"]["power_w"] == 0.06)
    assert not laser()["emission"]  # its shutter is closed
    told(shutter="OPENED")
    assert laser()["emission"] and abs(laser()["power_w"] - 0.06) < 0.001
    told(enabled="DISABLED")
    assert not laser()["emission"] and laser()["power_w"] == 0
    answer = sim.control(do="set", interlock="open")
    assert not answer["ok"] and '"part":"laser"' in answer["error"]
    answer = sim.control(do="values", part="detector")
    assert not answer["ok"] and "not made from a profile" in answer["error"]


def test_an_axis_begins_where_it_stands_and_keeps_its_place(start_sim):
    sim = start_sim("--fast", *made_from(axes="leadshine-pr"))

    def axis():
        return sim.control(do="state")["axes"]["theta_i"]

    assert abs(axis()["motor"] - 2.5) < 1e-9 and axis()["steps"] == 2500 and not axis()["homed"]
    assert sim.control(do="set", part="theta_i", values={"to": 10000, "speed": 4000, "motion.running": True})["ok"]
    wait_for(lambda: axis()["steps"] == 10000)
    assert abs(axis()["motor"] - 10) < 1e-9 and abs(axis()["load"] - 10) < 0.016
    assert sim.control(do="power-cycle", axis="theta_i")["ok"]
    assert axis()["steps"] == 10000 and abs(axis()["motor"] - 10) < 1e-9


def test_a_file_is_named_from_the_folder_of_sim_cfg(start_sim, tmp_path):
    folder = tmp_path / "mine"
    folder.mkdir()
    shutil.copy(ROOT / "configs" / "profiles" / "keithley-6485.cfg", folder / "meter.cfg")
    (folder / "sim.cfg").write_text('detector: { profile = "./meter.cfg"; signal_per_v = 1e-3; };\n')
    sim = start_sim("--config", folder / "sim.cfg", "--fast")
    bench = (sim.folder / "goniod.cfg").read_text()
    assert f'driver = "{folder}/meter.cfg"' in bench and "monitor_aux = 0" in bench and "slope_db = 6" in bench
    assert gonio("check", sim.folder / "goniod.cfg").returncode == 0
    assert sim.control(do="set", part="detector", values={"full_scale": 2e-9})["ok"]
    wait_for(lambda: abs(sim.control(do="values", part="detector")["values"]["current_a"] - 2e-10) < 1e-10)


@pytest.mark.parametrize("setting, says", [
    ("detector.profile=cobolt-05", "detector.profile = cobolt-05: is of the role laser, not detector"),
    ("laser.profile=nobody", "no profile 'nobody'"),
    ("axes.profile=sr830", "is of the role detector, not axis"),
    ("detector.profil=sr830", "did you mean 'profile'?"),
])
def test_what_cannot_play_the_part_is_refused(start_sim, setting, says):
    with pytest.raises(AssertionError, match="ready") as refused:
        start_sim("--fast", "--set", setting)
    assert says in str(refused.value)
