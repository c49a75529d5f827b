# SPDX-License-Identifier: MIT
"""What the links have seen: gonio devices, GET /api/v1/devices, and /metrics by the rules of the Prometheus text
format 0.0.4, read by a parser that refuses whatever the rules do not allow."""
import json
import math
import re

import pytest

from conftest import QUICK_LASER, UnixConnection, gonio, wait_for

NAME = re.compile(r"[a-zA-Z_:][a-zA-Z0-9_:]*")
LABEL = re.compile(r'([a-zA-Z_][a-zA-Z0-9_]*)="((?:[^"\\\n]|\\[\\"n])*)"')
KINDS = {"silent", "garbled", "misfit", "refused", "echo", "stray", "hung-up"}


def labels_of(text):
    """{'link': ...} of 'link="..."' with commas between, and nothing else."""
    labels = {}
    while text:
        m = LABEL.match(text)
        assert m, f"no label: {text}"
        assert m[1] not in labels, text
        labels[m[1]] = re.sub(r"\\(.)", lambda e: {"n": "\n"}.get(e[1], e[1]), m[2])
        text = text[m.end():]
        assert not text or text.startswith(","), text
        text = text.removeprefix(",")
    return labels


def parse(text):
    """{family: (type, {(sample name, labels): value})}; a family's lines stand together after its HELP and TYPE."""
    assert text.endswith("\n")
    families, current = {}, None
    for line in text[:-1].split("\n"):
        if line.startswith("# HELP "):
            current, help_text = line[7:].split(" ", 1)
            assert NAME.fullmatch(current) and help_text and current not in families, line
            families[current] = [None, {}]
        elif line.startswith("# TYPE "):
            name, kind = line[7:].split(" ")
            assert name == current and families[name] == [None, {}], line
            assert kind in ("counter", "gauge", "histogram", "summary", "untyped"), line
            families[name][0] = kind
        else:
            m = re.fullmatch(r"([^{ ]+)(?:\{(.*)\})? (\S+)", line)
            assert m, f"neither comment nor sample: {line!r}"
            kind, samples = families[current]
            suffixes = ("_bucket", "_sum", "_count") if kind == "histogram" else ("",)
            assert m[1] in [current + s for s in suffixes], line
            key = (m[1], tuple(sorted(labels_of(m[2] or "").items())))
            assert key not in samples, f"twice: {line}"
            samples[key] = float(m[3])
    assert all(kind for kind, _ in families.values())
    for name, (kind, _) in families.items():
        assert (kind == "counter") == name.endswith("_total"), name
    return families


def check_histogram(name, samples):
    """Buckets rise to +Inf, which is the count; one series for each set of other labels."""
    series = {}
    for (sample, labels), value in samples.items():
        labels = dict(labels)
        bound = labels.pop("le", None)
        assert (bound is not None) == sample.endswith("_bucket")
        one = series.setdefault(tuple(sorted(labels.items())), {"buckets": []})
        if bound is None:
            one[sample.removeprefix(name)] = value
        else:
            one["buckets"].append((float(bound), value))
    for one in series.values():
        bounds, counts = zip(*one["buckets"])
        assert list(bounds) == sorted(set(bounds)) and bounds[-1] == math.inf
        assert list(counts) == sorted(counts)
        assert counts[-1] == one["_count"] and one["_sum"] >= 0
    return series


def metrics(daemon):
    c = UnixConnection(daemon.socket)
    try:
        c.request("GET", "/metrics")
        r = c.getresponse()
        assert r.status == 200
        assert r.getheader("Content-Type") == "text/plain; version=0.0.4; charset=utf-8"
        return parse(r.read().decode())
    finally:
        c.close()


def value(families, family, **labels):
    return families[family][1][(family, tuple(sorted(labels.items())))]


def devices(daemon):
    status, body = daemon.request("GET", "/api/v1/devices")
    assert status == 200 and body["pid"] == daemon.pid
    return {d["name"]: d for d in body["devices"]}


def test_the_parser_refuses_what_the_format_does_not_allow():
    good = "# HELP a_total x\n# TYPE a_total counter\na_total{b=\"c\\\\\\\"\\n\"} 1\n"
    assert parse(good)["a_total"][1] == {("a_total", (("b", 'c\\"\n'),)): 1.0}
    for bad in (good[:-1], good + good, good + "b 1\n", good.replace("counter", "count"), good.replace(" 1", " one"),
                good.replace("\\\\\\\"", '"'), good.replace("_total", ""), good.replace("# TYPE", "# KIND")):
        with pytest.raises((AssertionError, ValueError, KeyError)):
            parse(bad)


def test_metrics_follow_the_text_format(daemon):
    families = metrics(daemon)
    links = {dict(labels)["link"] for _, labels in families["gonio_link_up"][1]}
    assert len(links) == 3  # the axes share a bus
    series = check_histogram("gonio_link_latency_seconds", families["gonio_link_latency_seconds"][1])
    assert {dict(labels)["link"] for labels in series} == links
    for link in links:
        assert value(families, "gonio_link_up", link=link) == 1
        assert value(families, "gonio_link_requests_total", link=link) >= dict(series)[(("link", link),)]["_count"] > 0
        assert value(families, "gonio_link_sent_bytes_total", link=link) > 0
        assert value(families, "gonio_link_received_bytes_total", link=link) > 0
        for kind in KINDS:
            assert value(families, "gonio_link_errors_total", link=link, kind=kind) == 0
    assert value(families, "gonio_build_info", version=gonio("--version").stdout.split()[1]) == 1
    assert value(families, "gonio_laser_emission") == 0
    assert value(families, "gonio_axis_position", axis="theta_r", unit="deg") == 0
    assert value(families, "gonio_run_state", state="idle") == 1


def test_devices_have_identity_position_and_latency(daemon):
    wait_for(lambda: devices(daemon)["theta_i"]["axis"]["position"] is not None)
    all_devices = devices(daemon)
    assert list(all_devices) == ["theta_i", "theta_r", "sample", "laser", "detector"]
    for d in all_devices.values():
        assert d["state"] == "ok" and d["why"] == "" and d["last_error"] is None
        latency = d["traffic"]["latency_s"]
        assert 0 < latency["p50"] <= latency["p95"] <= latency["p99"] <= latency["worst"] < 1
        assert set(d["traffic"]["errors"]) == KINDS and sum(d["traffic"]["errors"].values()) == 0
    laser, detector, axis = (all_devices[n] for n in ("laser", "detector", "theta_i"))
    assert (laser["kind"], laser["driver"], laser["serial"]) == ("laser", "cobolt-05", "12345")
    assert (detector["driver"], detector["serial"]) == ("sr830", "43480")
    assert laser["laser"]["emission"] is False and detector["detector"]["signal_v"] is not None
    assert axis["driver"] == "oriental-az" and axis["identity"] == "unit 1"
    assert axis["axis"]["position"] == axis["axis"]["dial"] == axis["axis"]["raw_steps"] == 0


def test_the_table_names_each_device(daemon):
    r = daemon.gonio("devices")
    assert r.returncode == 0 and r.stderr == "", r
    rows = [line.split("\t") for line in r.stdout.splitlines()]
    assert rows[0] == ["device", "driver", "state", "p50_ms", "p95_ms", "errors", "identity", "link", "last_error_age",
                       "last_error"]
    assert [row[0] for row in rows[1:]] == ["theta_i", "theta_r", "sample", "laser", "detector"]
    for row in rows[1:]:
        assert row[2] == "ok" and float(row[3]) <= float(row[4]) and row[5] == "none" and row[8:] == ["-", "-"]
    assert rows[4][6].startswith("Cobolt ") and rows[4][7].startswith("serial:")
    assert json.loads(daemon.gonio("devices", "--json").stdout)["devices"][3]["name"] == "laser"


def test_without_a_daemon_there_are_no_devices(tmp_path):
    r = gonio("devices", "--socket", tmp_path / "s")
    assert r.returncode == 3 and "no daemon" in r.stderr and r.stdout == ""


def test_errors_are_counted_by_kind_and_a_lost_device_says_why(start_sim, start_daemon):
    sim = start_sim("--fast", "--seed", "5", *QUICK_LASER)
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    assert sim.control(do="set", wire="axes", drop=1)["ok"]
    wait_for(lambda: devices(daemon)["theta_i"]["traffic"]["errors"]["silent"] == 1)
    bus = devices(daemon)["theta_i"]
    assert bus["state"] == "ok" and bus["errors"] == 0, "a question asked again is no failed call"
    assert bus["traffic"]["retries"] == 1 and bus["traffic"]["resyncs"] == 1

    assert sim.control(do="unplug", wire="detector")["ok"]
    wait_for(lambda: devices(daemon)["detector"]["state"] == "lost")
    d = devices(daemon)["detector"]
    assert d["traffic"]["errors"]["hung-up"] == 1 and d["errors"] >= 1
    assert "detector" in d["why"] and d["last_error"] and 0 <= d["last_error_age_s"] < 60
    families = metrics(daemon)
    assert value(families, "gonio_link_up", link=d["link"]) == 0
    assert value(families, "gonio_link_errors_total", link=d["link"], kind="hung-up") == 1
    r = daemon.gonio("devices")
    row = r.stdout.splitlines()[5].split("\t")
    assert r.returncode == 0 and row[2] == "LOST" and "hung-up 1" in row[5] and row[8].endswith(" s ago")
    assert r.stderr.startswith("gonio: detector is lost: ") and r.stderr.endswith("see: gonio doctor\n")

    assert sim.control(do="plug", wire="detector")["ok"]
    wait_for(lambda: devices(daemon)["detector"]["state"] == "ok")
    d = devices(daemon)["detector"]
    assert d["returns"] == 1 and d["why"] == "" and d["last_error"], "remembered when it is back"
    assert value(metrics(daemon), "gonio_link_reconnects_total", link=d["link"]) >= 1


def test_readings_are_counted(start_sim, start_daemon):
    sim = start_sim("--fast", "--seed", "5", *QUICK_LASER)
    daemon = start_daemon("--config", sim.folder / "goniod.cfg")
    reply = daemon.submit()
    reading = daemon.follow(reply["event_id"]).until(lambda e: e["event"] == "reading" and e["sweep"] >= 1)
    families = metrics(daemon)
    assert value(families, "gonio_run_state", state="running") == 1
    assert value(families, "gonio_laser_emission") == 1
    assert value(families, "gonio_run_number") == reply["run"]
    assert value(families, "gonio_run_readings") == reading["total"]
    assert value(families, "gonio_run_readings_done") >= reading["done"] > 0
    assert value(families, "gonio_readings_total") >= reading["done"], "darks and beams too"
