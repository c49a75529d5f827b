// SPDX-License-Identifier: MIT
// Which requests read the values that a profile asks for. Pure. Thread: any.
//
// Neighbours are read together while no more than registers.gap_most unwanted registers lie between
// them and the block stays within registers.block_most; nothing is read along that the profile
// forbids to read (written only, or "alone"). Both registers of a value always travel in one
// transaction. Blocks come in the order in which their first value is asked.
//
// A late answer carries no number that tells which request it answers (RTU): only its length can
// give it away. So no two requests to one table that follow each other have the same length, also
// from the last to the first: a block is made longer by a readable neighbour, or the order is
// changed. Where the profile allows neither, alike says so. One block alone follows only itself.
#pragma once
#include "drivers/profile.h"

struct block {
    int table; // enum profile_table
    int address, count;
    int first; // place of its first value in the asks
};

struct block_plan {
    struct block block[PROFILE_ASKS];
    int count;
    struct {           // one for each ask
        int value;     // of the profile
        int block, at; // where it is found: registers block's start
    } ask[PROFILE_ASKS];
    int asks;
    int alike; // a block that is as long as the next one; -1: none
};

// GON_E_INPUT: a name that the profile lacks, a value that is not readable, or its address.
int blocks_plan(const struct profile *p, const struct profile_asks *asks,
                struct block_plan *ret_plan, struct gon_error *err);

// Writes every plan of the profile, a line a request ("axis.status: function 3, 007Eh, 4 registers:
// output, alarm_code"), and what is wrong with one. Returns how many are wrong or have blocks
// alike.
int blocks_print(const struct profile *p, FILE *out);
