# SPDX-License-Identifier: MIT
"""Who runs the bench: commands of others are refused, a stop is not."""
import json
import urllib.parse

import pytest

from conftest import SMALL


NO_NAMES = ["x" * 65, "a%0Ab", "a%00b", "%1B[31m", "a" * 5000, "%FF%FE", "%C3%28", "%ED%A0%80"]


@pytest.fixture
def two(start_daemon):
    """A daemon, and its command as two people."""
    d = start_daemon()

    def person(name):
        def run(*args):
            before = d.env
            d.env = {**before, "GONIO_NAME": name}
            try:
                return d.gonio(*args)
            finally:
                d.env = before
        return run

    return d, person("Änne Müller"), person("bert")


def test_commands_of_others_are_refused(two, tmp_path):
    d, anne, bert = two
    config = tmp_path / "small.cfg"
    config.write_text(SMALL)
    assert "nobody has control" in bert("control").stdout
    follow = d.follow()
    assert anne("control", "take", "--reason", "night run").returncode == 0
    assert follow.until(lambda e: e["event"] == "control")["control"]["name"] == "Änne Müller"
    r = bert("control")
    assert r.stdout.startswith("Änne Müller has control since ") and r.stdout.endswith(": night run\n")
    for command in (("run", config), ("pause",), ("resume",), ("queue", "hold"), ("control", "release"),
                    ("control", "take")):
        r = bert(*command)
        assert r.returncode == 4 and "Änne Müller has control since" in r.stderr and "night run" in r.stderr, r
    assert bert("queue").returncode == 0 and bert("list").returncode == 0
    run = anne("run", "--detach", config)
    assert run.returncode == 0
    assert "Änne Müller" in bert("status").stdout
    assert bert("stop").returncode == 0, "a stop is everybody's"
    assert bert("control", "take", "--from", "carl").returncode == 4
    assert bert("control", "take", "--from", "Änne Müller").returncode == 0
    assert anne("control", "release").returncode == 4
    assert bert("control", "release").returncode == 0
    assert json.loads(anne("control", "--json").stdout) == {"control": None}


@pytest.mark.parametrize("name", NO_NAMES)
def test_what_is_no_name_is_refused(daemon, name):
    status, reply = daemon.request("POST", "/api/v1/control", {"do": "take"}, {"Gonio-Name": name})
    assert status == 400 and "Gonio-Name" in json.dumps(reply), reply
    assert daemon.status()["control"] is None


@pytest.mark.parametrize("name", NO_NAMES)
def test_a_stop_needs_no_name(daemon, name):
    status, reply = daemon.request("POST", "/api/v1/stop", headers={"Gonio-Name": name})
    assert status == 200 and reply["laser_off"], reply


def test_hostile_names_and_bodies(daemon):
    hostile = '<img src=x onerror=alert(1)>"\\'
    headers = {"Gonio-Name": urllib.parse.quote(hostile)}
    assert daemon.request("POST", "/api/v1/control", {"do": "take", "reason": "r" * 161}, headers)[0] == 400
    assert daemon.request("POST", "/api/v1/control", {"do": "take", "reason": "ä" * 80}, headers)[0] == 200
    status, reply = daemon.request("GET", "/api/v1/control")
    assert reply["control"]["name"] == hostile and reply["control"]["reason"] == "ä" * 80
    for body in ("", "[]", {"do": 7}, {"do": "steal"}, {"do": "take", "else": 1}):
        status, reply = daemon.request("POST", "/api/v1/control", body, headers)
        assert status == 400, body
    assert daemon.request("POST", "/api/v1/control", {"do": "take"})[0] == 400, "no name"
    assert daemon.request("POST", "/api/v1/pause")[0] == 409
    assert daemon.request("POST", "/api/v1/control", {"do": "release"}, headers)[0] == 200
