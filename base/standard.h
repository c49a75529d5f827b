// SPDX-License-Identifier: MIT
// Standard input, output and error of a program that was started with some of them closed. Thread:
// main, before anything else is opened.
#pragma once

// Gives a closed one's number to something that can neither be read nor written, so that no port or
// file gets it: what is said on standard error would go to the laser. Using it is an error as before.
void standard_hold(void);
