/* The board as a process on a computer, for tests: its six functions by a pipe or by SocketCAN. */
#ifndef HOST_H
#define HOST_H

#include "../core/pam_board.h"

/* Serves frames and readings that come through standard input; see pipe.c. Returns the exit code. */
int run_on_pipe(const struct pam_settings *settings);

/* Runs in real time on a CAN interface such as vcan0, with two small closed volumes. */
int run_on_socketcan(const struct pam_settings *settings, const char *interface);

#endif
