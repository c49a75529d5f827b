# SPDX-License-Identifier: MIT
"""What a campaign file keeps, and what the command says of it."""
import json
import shutil
import sqlite3

import pytest

from conftest import PATIENCE_S, ROOT, Daemon, gonio, query

PROFILES = ROOT / "configs" / "profiles"
BRIEF = """\
campaign: {
  name = "brief";
  theta_i_deg = [ 0.0 ];
  theta_r: { from_deg = -20.0; to_deg = 20.0; step_deg = 10.0; };
  dense: { half_width_deg = 0.0; };
  readings: { count = 2; };
};
"""


def measured(daemon, config=BRIEF):
    """The file of a campaign that was measured to its end."""
    reply = daemon.submit(config, "brief.cfg")
    daemon.follow(0).until_state(reply["run"], "done")
    return reply["file"]


def test_profiles_are_kept_in_the_file(daemon):
    file = measured(daemon)
    shown = daemon.gonio("show", file, "--profiles", "--json")
    assert shown.returncode == 0, shown.stderr
    kept = json.loads(shown.stdout)["profiles"]
    assert [(p["role"], p["name"]) for p in kept] == [
        ("laser", "cobolt-05"), ("detector", "sr830"), ("axis", "oriental-az")]
    for p in kept:
        text = (PROFILES / f"{p['name']}.cfg").read_text()
        assert p["text"] == text
        for name in (p["name"], p["id"]):
            printed = daemon.gonio("show", file, "--profile", name)
            assert (printed.returncode, printed.stdout) == (0, text)
    table = [line.split("\t") for line in daemon.gonio("show", file, "--profiles").stdout.splitlines()]
    assert table[0] == ["id", "since", "role", "name", "bytes"]
    assert [row[3] for row in table[1:]] == ["cobolt-05", "sr830", "oriental-az"]
    assert query(file, "pragma user_version") == [(4,)]
    missing = daemon.gonio("show", file, "--profile", "sr860")
    assert missing.returncode == 2 and "keeps no profile 'sr860'" in missing.stderr


def test_a_kept_profile_is_a_profile(daemon, tmp_path):
    """It can be checked and used again as it was."""
    file = measured(daemon)
    copy = tmp_path / "sr830.cfg"
    copy.write_text(daemon.gonio("show", file, "--profile", "sr830").stdout)
    checked = gonio("profile", "check", copy)
    assert checked.returncode == 0, checked.stderr


def test_a_daemon_with_a_wrong_profile_does_not_start(start_sim, tmp_path):
    """What it would measure with could not be kept."""
    sim = start_sim("--fast")
    bench = (sim.folder / "goniod-tcp.cfg").read_text()
    assert '"sr830"' in bench
    config = tmp_path / "bench.cfg"
    config.write_text(bench.replace('"sr830"', '"sr831"'))
    d = Daemon(tmp_path, "--config", config, ready=False)
    assert d.process.wait(PATIENCE_S) == 2
    assert "sr831" in d.errors()


@pytest.fixture(scope="module")
def whole(daemon, tmp_path_factory):
    """A measured file, to be copied and damaged."""
    copy = tmp_path_factory.mktemp("whole") / "0001-brief.gonio"
    shutil.copy(measured(daemon), copy)
    return copy


def damaged(whole, tmp_path, sql, name="0002-damaged.gonio"):
    path = tmp_path / name
    shutil.copy(whole, path)
    db = sqlite3.connect(path)
    triggers = db.execute("select name, sql from sqlite_schema where type = 'trigger'").fetchall()
    for trigger, _ in triggers:
        db.execute(f"drop trigger {trigger}")
    db.execute(sql)
    for _, text in triggers:
        db.execute(text)
    db.commit()
    db.close()
    return path


def test_verify_says_whole_or_names_what_is_not(whole, tmp_path):
    good = gonio("verify", whole)
    assert (good.returncode, good.stderr) == (0, ""), good.stdout
    assert good.stdout.startswith(f"{whole}: whole: ")
    bad = damaged(whole, tmp_path, "update reading set signal_v = 2 * signal_v where sweep = 1 and point = 3")
    both = gonio("verify", whole, bad)
    assert both.returncode == 1
    assert f"{bad}: sweep 1, point 3, attempt " in both.stdout and "check value is wrong" in both.stdout
    assert "1 of 2 files is damaged" in both.stderr
    files = json.loads(gonio("verify", "--json", whole, bad).stdout)["files"]
    assert [f["whole"] for f in files] == [True, False]
    (finding,) = files[1]["findings"]
    assert (finding["what"], finding["sweep"], finding["point"]) == ("reading", 1, 3)
    assert files[0]["readings"] == query(whole, "select count(*) from reading")[0][0]
    hole = damaged(whole, tmp_path, "delete from reading where sweep = 1 and point = 2", "0003-hole.gonio")
    assert "sweep 1, point 2: no accepted reading" in gonio("verify", hole).stdout


def test_verify_of_what_is_no_campaign(whole, tmp_path):
    csv = tmp_path / "data.csv"
    csv.write_text("theta_i_deg,f_r\n")
    assert gonio("verify", csv).returncode == 2
    assert gonio("verify", tmp_path / "no.gonio").returncode == 2
    assert gonio("verify").returncode == 2
    lost = tmp_path / "0004-lost.gonio"
    lost.write_bytes(b"\0" * 100 + whole.read_bytes()[100:])
    said = gonio("verify", lost)
    assert said.returncode == 1 and "not a campaign file" in said.stdout
    newer = damaged(whole, tmp_path, "pragma user_version = 99", "0005-newer.gonio")
    said = gonio("verify", newer)
    assert said.returncode == 4 and "install the newer one" in said.stderr


def test_verify_looks_at_a_file_that_is_being_measured(daemon):
    reply = daemon.submit(BRIEF.replace("step_deg = 10.0", "step_deg = 0.1"), "long.cfg")
    events = daemon.follow(0)
    for _ in range(3):
        for _ in range(10):
            events.until(lambda e: e["event"] == "reading" and e["run"] == reply["run"])
        (seen,) = json.loads(daemon.gonio("verify", "--json", reply["run"]).stdout)["files"]
        assert seen["whole"] and seen["writer_pid"] == daemon.pid
        assert 0 < seen["readings"] < seen["points"]
    daemon.gonio("stop")
    events.until_state(reply["run"], "stopped")


def test_a_folder_has_one_daemon(daemon, start_sim, tmp_path):
    """Another socket and another bench, but the same campaigns."""
    sim = start_sim("--fast")
    second = Daemon(tmp_path, "--config", sim.folder / "goniod-tcp.cfg", "--dir", daemon.directory, ready=False)
    assert second.process.wait(PATIENCE_S) == 4
    assert f"in use by process {daemon.pid}" in second.errors()
    assert "--dir" in second.errors()
    assert daemon.gonio("status").returncode == 0


def test_backup_is_a_verified_copy(whole, tmp_path):
    copy = tmp_path / "copy.gonio"
    made = gonio("backup", whole, copy)
    assert made.returncode == 0, made.stderr
    assert made.stdout.startswith(f"{copy}: a copy of {whole}, whole: ")
    for table in ("reading", "plan", "meta", "profile", "event", "state", "reduced", "fit"):
        assert query(copy, f"select * from {table}") == query(whole, f"select * from {table}"), table
    assert query(copy, "pragma user_version") == query(whole, "pragma user_version")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["copy.gonio"]
    before = copy.read_bytes()
    again = gonio("backup", whole, copy)
    assert again.returncode == 4 and "there already" in again.stderr
    assert copy.read_bytes() == before
    folder = tmp_path / "safe"
    folder.mkdir()
    assert json.loads(gonio("backup", "--json", whole, folder).stdout)["copy"] == str(folder / whole.name)
    assert gonio("verify", folder / whole.name).returncode == 0
    bad = damaged(whole, tmp_path, "update reading set signal_v = 2 * signal_v where sweep = 1 and point = 3")
    kept = gonio("backup", bad, tmp_path / "bad-copy.gonio")
    assert kept.returncode == 1 and "sweep 1, point 3" in kept.stderr and "is damaged" in kept.stderr
    assert gonio("backup", whole, tmp_path / "no" / "copy.gonio").returncode == 1
    assert gonio("backup", whole).returncode == 2


def test_backup_while_it_is_measured(daemon, tmp_path):
    """Again and again: each copy is whole and the run does not notice."""
    reply = daemon.submit(BRIEF.replace("step_deg = 10.0", "step_deg = 0.5"), "long.cfg")
    events, last = daemon.follow(0), 0
    events.until(lambda e: e["event"] == "reading" and e["run"] == reply["run"])
    for k in range(5):
        made = daemon.gonio("backup", "--json", reply["run"], tmp_path / f"{k}.gonio")
        assert made.returncode == 0, made.stderr
        readings = json.loads(made.stdout)["readings"]
        assert readings >= max(last, 1)
        last = readings
    events.until_state(reply["run"], "done")
    paused = query(reply["file"], "select why from state where state = 'paused'")
    assert paused == []
