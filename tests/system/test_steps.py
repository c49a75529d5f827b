# SPDX-License-Identifier: MIT
"""What a person does on the way: in the dry run, at the prompt and over HTTP."""
import json
import re

from conftest import QUICK_LASER, gonio, query

PLAN = """\
campaign: {
  name = "steps";
  theta_i_deg = [ 20.0, 40.0 ];
  theta_r: { from_deg = -60.0; to_deg = 60.0; step_deg = 20.0; };
  dense: { half_width_deg = 0.0; };
  steps = ( { before_sweep = 2; text = "turn the sample by 90 deg"; } );
};
"""


def bench_with_steps(sim, folder):
    text = (sim.folder / "goniod.cfg").read_text()
    text, n = re.subn(r'(name = "beam";)', r'\1 arrive = "take the sample out"; leave = "put the sample in";', text)
    assert n == 1
    path = folder / "goniod.cfg"
    path.write_text(text + 'daemon: { step_limit_s = 1.0; };\n' if "daemon:" not in text else text)
    return path


def test_steps_are_planned_asked_for_and_acknowledged(start_sim, start_daemon, tmp_path):
    sim = start_sim("--fast", "--seed", "5", *QUICK_LASER)
    bench = bench_with_steps(sim, tmp_path)
    (tmp_path / "steps.cfg").write_text(PLAN)
    shown = gonio("plan", "--bench", bench, tmp_path / "steps.cfg")
    steps = re.findall(r"^step: (.*) \(the run waits", shown.stderr, re.M)
    assert steps == ["before the opening references: take the sample out", "before sweep 1: put the sample in",
                     "before sweep 2: turn the sample by 90 deg", "before the closing references: take the sample out"]
    planned = json.loads(gonio("plan", "--json", "--bench", bench, tmp_path / "steps.cfg").stdout)["steps"]
    assert [s["sweep"] for s in planned] == [0, 1, 2, 3]

    daemon = start_daemon("--config", bench)
    assert daemon.gonio("ack").returncode == 4
    reply = daemon.submit(PLAN, "steps.cfg")
    run, events = reply["run"], daemon.follow(0)
    for i, step in enumerate(planned):
        asked = events.until_state(run, "paused")
        assert asked["text"] == f"operator: {step['text']}, then: gonio ack" and asked["asks"] == step["text"]
        assert not sim.control(do="state")["laser"]["emission"]
        if i == 0:  # nobody comes in time
            again = events.until_state(run, "paused")
            assert again["text"].endswith(" (not acknowledged for 1 s)") and again["asks"] == step["text"]
            assert re.search("^to do +take the sample out; when that is done: gonio ack$",
                             daemon.gonio("status").stdout, re.M)
            refused = daemon.gonio("resume")
            assert refused.returncode == 4 and "take the sample out" in refused.stderr
            assert daemon.request("POST", "/api/v1/ack", {"note": 7})[0] == 400
        r = gonio("ack", "--note", f"step {i}", env=daemon.env | {"GONIO_NAME": "anna"})
        assert r.returncode == 0, r
        events.until(lambda e: e["event"] == "state" and e["state"] != "paused")
    events.until_state(run, "done")
    kept = [t for t, in query(reply["file"], "select text from event where text like '%acknowledged by%' order by id")]
    assert len(kept) == 4
    for i, text in enumerate(kept):
        assert re.search(rf"acknowledged by the operator anna \(uid \d+\): step {i} \({planned[i]['text']}\)", text), text
    assert query(reply["file"], "select count(*) from reading where flags = 0") == query(
        reply["file"], "select count(*) from plan")


def test_a_wrong_step_is_refused(tmp_path):
    for old, new, says in (("before_sweep = 2", "before_sweep = 4", "there are 2 sweeps; allowed 0..3"),
                           ('"turn the sample by 90 deg"', '""', "say what is to be done"),
                           ("steps = (", 'steps = ( { before_sweep = 2; text = "x"; },', "has a step already")):
        (tmp_path / "wrong.cfg").write_text(PLAN.replace(old, new))
        r = gonio("check", tmp_path / "wrong.cfg")
        assert r.returncode == 2 and says in r.stdout + r.stderr, r
