// SPDX-License-Identifier: MIT
// The host's part of USBTMC over any struct usb_io: tags, questions and answers, and what to do
// when they go wrong. It reports an error at once and mends the link before the next command, in
// the time of that call:
//
//   no answer in time      reading on waits for the same answer; the next command aborts it first
//                          (INITIATE_ABORT_BULK_IN, CHECK until it is done), then INITIATE_CLEAR
//                          and CHECK_CLEAR, which empty the device: the answer may come yet
//   wrong tag, id or size  the same; also when more comes than the header says, and it is not zeros
//   a command half taken   INITIATE_ABORT_BULK_OUT, CHECK, clear halt
//   stall                  the halt is cleared at once, then INITIATE_CLEAR, CHECK_CLEAR
//   CHECK_CLEAR pending    asked every 50 ms for 1 s, then the device is reset by its port
//
// Inside this layer. Thread: the transport's.
#pragma once
#include "base/clk.h"
#include "drivers/usb_io.h"

enum { USBTMC_CHUNK = 4096 }; // payload of one transfer, either way

struct usbtmc_host {
    struct usb_io *io;
    struct clk *clk;
    const char *name; // in messages
    struct usb_shape shape;
    struct usbtmc_capabilities can;
    uint8_t tag, status_tag;
    int status_failed; // times in a row
    // bulk-in
    bool asked;    // a request is out, its transfer not whole
    bool begun;    // its header was read
    bool end;      // and says that the message ends with it
    uint32_t left; // payload of it that is still to come
    uint8_t pad;   // bytes that may follow the payload: to a multiple of 4
    bool ended;    // what was read last ended the message
    // bulk-out
    bool halfway; // a transfer broke off
    bool broken;  // nothing goes before INITIATE_CLEAR
    uint64_t aborts, clears, halts, resets;
    size_t at, have; // payload in buffer that was not taken yet
    uint8_t buffer[USBTMC_CHUNK + 1024], frame[USBTMC_CHUNK + USBTMC_HEADER + 4];
};

// Borrows io, clk and name. Nothing is sent before usbtmc_host_start.
void usbtmc_host_init(struct usbtmc_host *h, struct usb_io *io, struct clk *clk, const char *name);

// After io was opened, also again: capabilities, INITIATE_CLEAR (a process before us may have left
// half a message), REN_CONTROL where the device takes it. GON_E_DEVICE: does not answer as USBTMC.
int usbtmc_host_start(struct usbtmc_host *h, const struct usb_shape *shape, int64_t deadline_ns,
                      struct gon_error *err);

// One whole message. GON_E_DEVICE: could not be cleared before it and was reset.
int usbtmc_host_write(struct usbtmc_host *h, const uint8_t *data, size_t size, int64_t deadline_ns,
                      struct gon_error *err);
// Bytes of an answer; 0 only when it ended with nothing more. h->ended says whether it did.
int usbtmc_host_read(struct usbtmc_host *h, uint8_t *data, size_t size, int64_t deadline_ns,
                     struct gon_error *err);
// Mends what went wrong; with clear it empties the device whatever went before. Without, an answer
// that nobody read is thrown away if the status byte tells of one (USB488). A device that three
// times in a row does not say its status, or tells of an answer that does not come, is not asked
// again. Returns the bytes dropped.
int usbtmc_host_drain(struct usbtmc_host *h, bool clear, int64_t deadline_ns,
                      struct gon_error *err);
