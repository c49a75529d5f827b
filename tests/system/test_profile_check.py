# SPDX-License-Identifier: MIT
"""gonio profile check, doc, list and settings on what is shipped and on a profile with mistakes."""
import json

import pytest

from conftest import ROOT, gonio

SHIPPED = sorted((ROOT / "configs" / "profiles").glob("*.cfg"))

METER = """\
profile: { name = "meter"; title = "Meter"; role = "inputs"; protocol = "message"; source = "its manual"; };
values: ( { name = "x"; unit = "V"; max = 5; help = "the | voltage"; } );
framing: { end_out = "\\r"; end_in = "\\r\\n"; };
exchanges: ( { name = "x"; send = "x?"; answer = "{x}"; }, { name = "set"; send = "x {x:.2f}"; answer = "OK"; } );
inputs: { status = ( "x" ); };
golden: ( { does = "set"; with = "x = 2"; sent = "x 2.00"; received = "OK"; source = "manual, page 3"; } );
"""


def write(path, text):
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_what_is_shipped_is_right(path):
    r = gonio("profile", "check", path)
    assert r.returncode == 0, r.stderr
    assert r.stdout.startswith(f"{path.stem}: ") and r.stderr == ""


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_each_has_a_reference_page(path):
    r = gonio("profile", "doc", path)
    assert r.returncode == 0 and r.stderr == ""
    assert r.stdout.startswith("# ") and "\n## Values\n" in r.stdout and "\nSource: " in r.stdout


def test_a_mismatch_says_got_expected_and_where(tmp_path):
    good = write(tmp_path / "good.cfg", METER)
    bad = write(tmp_path / "bad.cfg", METER.replace('"x 2.00"', '"x 2.000"'))
    r = gonio("profile", "check", good, bad)
    assert r.returncode == 2
    assert r.stderr == f"{bad}: golden[0] (set): sent: got x 2.00\\r / expected x 2.000\\r / at byte 6\n"
    assert "golden      1 of 1 entries pass\n" in r.stdout and "golden      0 of 1 entries pass\n" in r.stdout


def test_a_mistake_is_told_with_its_line(tmp_path):
    path = write(tmp_path / "m.cfg", METER.replace('answer = "{x}"', 'answer = "{y}"'))
    r = gonio("profile", "check", path)
    assert r.returncode == 2 and r.stdout == ""
    assert r.stderr == f"{path}:4: exchanges[0].answer = \"{{y}}\": there is no such value at '{{y}}'\n"


def test_an_unknown_profile_is_told_where_it_was_looked_for():
    r = gonio("profile", "check", "nobody")
    assert r.returncode == 2 and "no profile 'nobody': looked for " in r.stderr
    assert "given as a path: ./NAME.cfg" in r.stderr


def test_a_page_keeps_its_table(tmp_path):
    r = gonio("profile", "doc", write(tmp_path / "m.cfg", METER))
    assert "| `x` | real | V | 0 .. 5 | the \\| voltage |\n" in r.stdout
    assert "- `x 2.00`: manual, page 3\n" in r.stdout


def test_list_names_those_of_a_folder_and_those_shipped(tmp_path, monkeypatch):
    write(tmp_path / "meter.cfg", METER)
    monkeypatch.setenv("GONIO_PROFILES", str(tmp_path))
    r = gonio("profile", "list")
    assert r.returncode == 0, r.stderr
    names = [line.split("\t")[0] for line in r.stdout.splitlines()]
    assert names == ["name", "meter"] + [p.stem for p in SHIPPED]


MEMBERS = ["file", "well", "mistakes", "name", "title", "role", "protocol", "values", "exchanges", "writes", "golden",
           "unverified", "requests", "requests_wrong"]


def test_check_as_json_of_what_is_right():
    r = gonio("profile", "check", "--json", *SHIPPED)
    assert r.returncode == 0 and r.stderr == ""
    o = json.loads(r.stdout)
    assert list(o) == ["well", "profiles"] and o["well"] is True
    assert [p["name"] for p in o["profiles"]] == [p.stem for p in SHIPPED]
    for p in o["profiles"]:
        assert sorted(p) == sorted(MEMBERS) and p["well"] is True and p["mistakes"] == []
        golden = p["golden"]
        assert golden["pass"] == golden["entries"] and golden["recorded"] == 0 and golden["failures"] == []
        assert p["values"] > 0 and p["exchanges" if p["protocol"] == "message" else "writes"] > 0
        assert (len(p["requests"]) > 0) == (p["protocol"] == "modbus") and p["requests_wrong"] == 0


def test_check_as_json_of_what_is_wrong(tmp_path):
    bad = write(tmp_path / "bad.cfg", METER.replace('"x 2.00"', '"x 2.000"').replace("manual, page 3", "recorded here"))
    mistake = write(tmp_path / "mistake.cfg", METER.replace('answer = "{x}"', 'answer = "{y}"'))
    odd = write(tmp_path / "\udcff.cfg", METER)
    r = gonio("profile", "check", bad, mistake, "nobody", odd, "--json")
    assert r.returncode == 2 and r.stderr == ""
    o = json.loads(r.stdout)
    assert o["well"] is False
    failed, wrong, missing, right = o["profiles"]
    assert all(sorted(p) == sorted(MEMBERS) for p in o["profiles"])
    assert failed["well"] is False and failed["mistakes"] == [] and failed["name"] == "meter"
    assert failed["golden"] == {"entries": 1, "pass": 0, "recorded": 1, "failures": [
        {"entry": 0, "does": "set", "text": "sent: got x 2.00\\r / expected x 2.000\\r / at byte 6"}]}
    assert wrong["file"] == str(mistake) and wrong["well"] is False
    assert wrong["mistakes"] == [f"{mistake}:4: exchanges[0].answer = \"{{y}}\": there is no such value at '{{y}}'"]
    assert missing["file"] == "nobody" and "no profile 'nobody'" in missing["mistakes"][0]
    for p in (wrong, missing):
        assert all(p[name] is None for name in MEMBERS[3:])
    assert right["well"] is True and right["file"] == str(tmp_path / "?.cfg")


def test_list_as_json(tmp_path, monkeypatch):
    meter = write(tmp_path / "meter.cfg", METER)
    write(tmp_path / "wrong.cfg", "profile: {")
    monkeypatch.setenv("GONIO_PROFILES", str(tmp_path))
    r = gonio("profile", "list", "--json")
    assert r.returncode == 2 and r.stderr == ""
    o = json.loads(r.stdout)
    assert list(o) == ["profiles", "mistakes"] and "wrong.cfg" in o["mistakes"][0]
    assert o["profiles"][0] == {"name": "meter", "role": "inputs", "title": "Meter", "file": str(meter)}
    assert len(o["profiles"]) == 1 + len(SHIPPED)


def test_what_was_recorded_is_told(tmp_path):
    r = gonio("profile", "check", write(tmp_path / "m.cfg", METER.replace("manual, page 3", "recorded today")))
    assert "  golden      1 of 1 entries pass\n  recorded    1 of them, from an instrument\n" in r.stdout


def test_settings_are_the_manuals():
    r = gonio("profile", "settings")  # a star in them is no beginning of bold
    assert r.returncode == 0 and "*values[].shares*: text" in r.stdout and "like this (\\* and ? as" in r.stdout


def test_a_laser_that_the_guard_cannot_see_off_is_refused(tmp_path):
    text = (ROOT / "configs/profiles/cobolt-05.cfg").read_text()
    good = gonio("profile", "check", ROOT / "configs/profiles/cobolt-05.cfg")
    assert good.returncode == 0 and "guard       can switch it off and see it" in good.stdout, good
    is_off = 'is_off = "emission = 0 and mode != 1 and mode != 2 and mode != 3"'
    assert is_off in text
    bad = tmp_path / "bad.cfg"
    bad.write_text(text.replace(is_off, 'is_off = "power_w < 0.001"').replace('off_asks = ( "emission", "mode" )',
                                                                            'off_asks = ( "power" )'))
    r = gonio("profile", "check", bad)
    assert r.returncode == 2 and "power_w" in r.stderr and "guard" in r.stderr, r
