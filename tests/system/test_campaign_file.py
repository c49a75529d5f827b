# SPDX-License-Identifier: MIT
"""What a campaign file keeps, and what the command says of it."""
import json

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
    assert query(file, "pragma user_version") == [(3,)]
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
