# SPDX-License-Identifier: MIT
"""The daemon's HTTP: shapes, limits, replay. One daemon serves all tests of this file."""
import json
import os
import socket
import sqlite3
import stat
import threading
import time

import pytest

from conftest import PATIENCE_S, Stream, wait_for


def raw(daemon, data):
    """Bytes in, what comes back until the server closes or a whole answer with a JSON body is there."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as s:
        s.settimeout(PATIENCE_S)
        s.connect(str(daemon.socket))
        s.sendall(data)
        answer = b""
        while not answer.endswith(b"}"):
            try:
                part = s.recv(65536)
            except ConnectionResetError:  # it closed before it had read all of a refused request
                break
            if not part:
                break
            answer += part
    return answer


def test_status_has_devices_and_no_run(daemon):
    s = daemon.status()
    assert s["pid"] == daemon.pid and s["state"] == "idle"
    assert s["run"] is None and s["queued"] == []
    devices = {d["name"]: d for d in s["devices"]}
    assert set(devices) == {"theta_i", "theta_r", "sample", "laser", "detector"}
    assert all(d["link"] == "ok" for d in devices.values()), devices
    assert devices["laser"]["emission"] is False
    assert devices["theta_i"]["unit"] == "deg"


def test_socket_is_for_owner_and_group(daemon):
    assert stat.S_IMODE(os.stat(daemon.socket).st_mode) == 0o660


def test_unknown_resources_and_methods(daemon):
    status, body = daemon.request("GET", "/api/v1/nothing")
    assert status == 404 and set(body) == {"error", "where", "what_to_do"}
    assert daemon.request("GET", "/api/v1/runs/999")[0] == 404
    assert daemon.request("GET", "/api/v1/runs/x")[0] == 404
    status, body = daemon.request("DELETE", "/api/v1/runs")
    assert status == 405 and body["what_to_do"] == "use: GET, POST"
    status, body = daemon.request("GET", "/api/v1/stop")
    assert status == 405 and body["what_to_do"] == "use: POST"


@pytest.mark.parametrize("body", [
    "", "{", "[]", "[1,2]", "null", '{"config": 7}', '{"config": "x", "extra": 1}', '{"resume": -1}',
    '{"resume": 1.5}', '{"resume": null}', '{"config": "a", "config": "b"}', b'{"config": "\xff"}',
    '{"config": "a"} trailing', "[" * 5000,
])
def test_bodies_that_are_not_what_was_asked_for(daemon, body):
    status, reply = daemon.request("POST", "/api/v1/runs", body)
    assert status == 400, reply
    assert reply["error"] and reply["what_to_do"]


def test_a_wrong_configuration_names_its_lines(daemon):
    config = 'campaign: {\n  name = "x";\n  theta_i_deg = [ 0.0, 95.0 ];\n  stpe = 3;\n};\n'
    status, reply = daemon.request("POST", "/api/v1/runs", {"config": config, "name": "configs/bad.cfg"})
    assert status == 400
    text = json.dumps(reply)
    assert "configs/bad.cfg:3" in text and "configs/bad.cfg:4" in text and "stpe" in text
    assert daemon.request("GET", "/api/v1/runs")[1]["runs"] == []


@pytest.mark.parametrize("config, error", [
    ("", "x.cfg:1: campaign: missing; What to measure."),
    ("campaign: { name = ", "x.cfg:2: syntax error; look for a missing ';', quote or bracket here or on the line before"),
])
def test_a_complaint_about_a_configuration_is_whole(daemon, config, error):
    status, body = daemon.request("POST", "/api/v1/runs", {"config": config, "name": "x.cfg"})
    where, what = error.split(": ", 1)
    assert status == 400
    assert body == {"error": what, "where": where, "what_to_do": "mend it and try again"}


def test_a_run_has_one_address(start_daemon):
    daemon = start_daemon()
    run = daemon.submit()["run"]
    assert run == 1 and daemon.request("GET", "/api/v1/runs/1")[0] == 200
    for other in ("+1", "01", "1%00", "%201", "-1", "1x", "1/", "", "0", "4294967297", "9" * 40):
        assert daemon.request("GET", f"/api/v1/runs/{other}")[0] == 404, other


def test_nothing_to_pause_or_resume_is_a_conflict(daemon):
    for what in ("pause", "resume"):
        status, reply = daemon.request("POST", f"/api/v1/{what}")
        assert status == 409 and "no run is active" in reply["error"]
    assert daemon.request("POST", "/api/v1/runs", {"resume": 999})[0] == 400
    assert daemon.request("POST", "/api/v1/runs", {"resume": "/nowhere.gonio"})[0] in (400, 404)


def test_a_stop_with_nothing_to_stop_halts_all_the_same(daemon):
    before = daemon.bench.control(do="state")["laser"]["offs"]
    status, reply = daemon.request("POST", "/api/v1/stop")
    assert status == 200 and reply["run"] is None and reply["laser_off"] is True
    assert daemon.bench.control(do="state")["laser"]["offs"] > before


def test_two_lengths_are_refused(daemon):
    head = b"POST /api/v1/runs HTTP/1.1\r\nHost: x\r\n"
    both = raw(daemon, head + b"Content-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n")
    assert both.startswith(b"HTTP/1.1 400")
    twice = raw(daemon, head + b"Content-Length: 2\r\nContent-Length: 3\r\n\r\n{}")
    assert twice.startswith(b"HTTP/1.1 400")


def test_sizes_are_limited(daemon):
    status, _ = daemon.request("POST", "/api/v1/runs", "x" * (64 * 1024 + 1))
    assert status == 413
    head = b"GET /api/v1/status HTTP/1.1\r\nHost: x\r\nX: "
    for size in (8300, 40000):  # refused by us, and by the library
        assert raw(daemon, head + b"y" * size + b"\r\n\r\n").startswith(b"HTTP/1.1 431")


def test_garbage_is_survived(daemon):
    for data in (b"GET\r\n\r\n", b"\xff\xfe\r\n\r\n", b"GET / HTTP/9.9\r\nHost: x\r\n\r\n"):
        raw(daemon, data)
    for data in (b"\0" * 100, b"GET / HT", b"POST /api/v1/stop HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\n{"):
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as s:
            s.connect(str(daemon.socket))
            s.sendall(data)
    assert daemon.status()["pid"] == daemon.pid


def test_the_ninth_stream_is_refused_and_a_closed_one_makes_room(daemon):
    streams = [Stream(daemon.socket) for _ in range(8)]
    assert all(s.response.status == 200 for s in streams)
    ninth = Stream(daemon.socket)
    assert ninth.response.status == 503
    ninth.close()
    for s in streams:
        s.close()
    for _ in range(3):  # each is noticed at once, not at the next ping
        s = Stream(daemon.socket)
        assert s.response.status == 200
        s.close()


def test_last_event_id_must_be_a_number(daemon):
    s = Stream(daemon.socket, last_id="yesterday")
    assert s.response.status == 400
    s.close()


def test_a_stop_gets_through_whatever_others_hold_open(start_daemon):
    daemon = start_daemon()
    silent = []
    try:
        for _ in range(100):
            s = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            silent.append(s)
            s.settimeout(10)
            s.connect(str(daemon.socket))
            s.sendall(b"GET /api/v1/status HTTP/1.1\r\n")  # and nothing more
        status, _ = daemon.request("GET", "/api/v1/runs")
        assert status == 503
        begun = time.monotonic()
        status, reply = daemon.request("POST", "/api/v1/stop")
        assert status == 200 and reply["laser_off"], reply
        assert time.monotonic() - begun < 2
    finally:
        for s in silent:
            s.close()


def test_every_stop_is_answered_however_many_come_at_once(start_daemon):
    """The file's write lock is held, so that the first 32 have to wait for the run's end."""
    daemon = start_daemon()
    reply = daemon.submit()
    daemon.follow(reply["event_id"]).until(lambda e: e["event"] == "reading")
    db = sqlite3.connect(reply["file"], isolation_level=None)
    db.execute("begin immediate")
    answers = []

    def stop():
        answers.append(daemon.request("POST", "/api/v1/stop"))

    threads = [threading.Thread(target=stop) for _ in range(40)]
    for t in threads:
        t.start()
    wait_for(lambda: len(answers) == 8)
    db.execute("rollback")
    for t in threads:
        t.join()
    db.close()
    refused = [body for status, body in answers if status == 503]
    assert len(answers) == 40 and len(refused) == 8, answers
    assert all("a stop is under way" in body["error"] for body in refused)
    assert all(body["state"] == "stopped" for status, body in answers if status == 200)
