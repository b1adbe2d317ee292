#define _DEFAULT_SOURCE
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "host.h"

#define FIRMWARE_VERSION 1
#define PRIORITY 30

static void explain(void)
{
    fprintf(stderr,
            "usage: pam_board (--pipe | --can INTERFACE) [--number N] [--with-canopen]\n"
            "                 [--boot-ms MS] [--max-pressure PA0 PA1]\n");
}

/* A whole number from 0 to `most`; ends the program for anything else. */
static long number(const char *option, const char *text, long most)
{
    char *end = NULL;
    const long value = text == NULL ? -1 : strtol(text, &end, 10);

    if (text == NULL || *text == '\0' || *end != '\0' || value < 0 || value > most) {
        fprintf(stderr, "pam_board: %s needs a whole number from 0 to %ld\n", option, most);
        exit(2);
    }
    return value;
}

/* A board does not wait for other work of this computer, and a simulated rig with a real-time priority
 * waits for the answers of its board. Where the system does not permit it, the priority stays. */
static void take_priority(void)
{
    struct sched_param wanted;

    memset(&wanted, 0, sizeof wanted);
    wanted.sched_priority = PRIORITY;
    (void)sched_setscheduler(0, SCHED_FIFO, &wanted);
}

int main(int count, char **given)
{
    struct pam_settings settings = {0, false, 50000u, {INT32_MAX, INT32_MAX}, FIRMWARE_VERSION};
    const char *interface = NULL;
    bool pipe = false;

    for (int place = 1; place < count; place++) {
        const char *option = given[place];
        const char *next = place + 1 < count ? given[place + 1] : NULL;

        if (strcmp(option, "--pipe") == 0) {
            pipe = true;
        } else if (strcmp(option, "--with-canopen") == 0) {
            settings.shares_with_canopen = true;
        } else if (strcmp(option, "--can") == 0 && next != NULL) {
            interface = next;
            place++;
        } else if (strcmp(option, "--number") == 0) {
            settings.number = (uint8_t)number(option, next, 15);
            place++;
        } else if (strcmp(option, "--boot-ms") == 0) {
            settings.boot_us = 1000u * (uint32_t)number(option, next, 60000);
            place++;
        } else if (strcmp(option, "--max-pressure") == 0) {
            settings.max_pressure[0] = (int32_t)number(option, next, INT32_MAX);
            next = place + 2 < count ? given[place + 2] : NULL;
            settings.max_pressure[1] = (int32_t)number(option, next, INT32_MAX);
            place += 2;
        } else {
            explain();
            return 2;
        }
    }
    if (pipe == (interface != NULL)) {
        explain();
        return 2;
    }
    take_priority();
    return pipe ? run_on_pipe(&settings) : run_on_socketcan(&settings, interface);
}
