// SPDX-License-Identifier: MIT
// The end of last resort: a thread of its own that ends the process when the others do not come
// back in time (a disk that hangs, devices that are frozen, a laser that ignores OFF). What was
// committed is safe: SQLite recovers it from the file at the next start. Thread: any.
#pragma once

// After seconds writes the text (borrowed for ever: a literal) to stderr and ends the process with
// the status, without cleaning up. A process that ended before never hears of it.
void deadline_set(double seconds, const char *text, int status);
