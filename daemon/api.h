// SPDX-License-Identifier: MIT
// /api/v1 and /metrics: which request asks the hub for what.
//
//   GET  /api/v1/status          the daemon, the run that has the bench, devices
//   GET  /api/v1/devices         each device with what its link has seen
//   GET  /metrics                the same and more for Prometheus
//   GET  /api/v1/runs            all runs, newest last
//   GET  /api/v1/runs/N          one, with its last fit
//   POST /api/v1/runs            {"config": text, "name": path} or {"resume": N or path}: 201
//   POST /api/v1/stop            laser off, axes halted; answers when that is so
//   POST /api/v1/pause, /resume  the run that has the bench
//   GET  /api/v1/events          server-sent events; Last-Event-ID replays
//
// Errors are {"error", "where", "what_to_do"}: 400 a wrong request or configuration, 404, 405, 409
// refused, 413, 431, 500, 503. Thread: main.
#pragma once
#include "daemon/http.h"

struct http_reply api_request(void *hub, const struct http_request *request, uint64_t ticket);

int api_status(int gon_code);                 // the HTTP status of an error
char *api_error(int gon_code, const char *text); // its body; a text "file:line: what" gives where
char *api_complaints(const char *text); // the same of a configuration's complaints, as they are
char *api_no_run(int run);
