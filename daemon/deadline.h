// SPDX-License-Identifier: MIT
// The end of last resort: a thread of its own that ends the process when the others do not come
// back in time (a disk that hangs, devices that are frozen). What was committed is safe: SQLite
// recovers it from the file at the next start. Thread: any.
#pragma once

struct deadline;

// After seconds writes the last words (borrowed for ever: a literal) to stderr and ends the process
// with the status, without cleaning up. A process that ended before never hears of it. NULL without
// memory or thread.
struct deadline *deadline_set(double seconds, const char *words, int status);
// Other last words, while there is time; NULL is fine.
void deadline_say(struct deadline *d, const char *words);
