/* The core of a valve board: everything that docs/can_protocol.md demands, and no hardware.
 *
 * Portable C99 without heap, operating system and floating-point numbers. The hardware is behind the
 * six functions of `struct pam_hardware`. Call `pam_board_init` once and `pam_board_step` at least
 * 1000 times per second, from one thread.
 */
#ifndef PAM_BOARD_H
#define PAM_BOARD_H

#include <stdbool.h>
#include <stdint.h>

#define PAM_CHANNELS 2
#define PAM_CRC_LIMIT 10 /* wrong checksums within one second, while active */
#define PAM_FULL_SCALE 32767

struct pam_frame {
    uint16_t identifier; /* 11 bits */
    uint8_t length;
    uint8_t data[8];
};

/* As `State` in the DBC file. */
enum pam_state { PAM_BOOT = 0, PAM_VENTED = 1, PAM_ACTIVE = 2, PAM_FAULT = 3 };

/* Bits of `faults`, as the signals Fault... in the DBC file. */
enum pam_fault {
    PAM_FAULT_WATCHDOG = 1 << 0,
    PAM_FAULT_CRC = 1 << 1,
    PAM_FAULT_OVER_PRESSURE = 1 << 2,
    PAM_FAULT_SENSOR = 1 << 3,
    PAM_FAULT_SUPPLY = 1 << 4,
    PAM_FAULT_VALVE = 1 << 5,
    PAM_FAULT_TEMPERATURE = 1 << 6,
    PAM_FAULT_INTERNAL = 1 << 7,
    PAM_FAULT_HOST = 1 << 8,
    PAM_FAULT_EMERGENCY_STOP = 1 << 9
};

/* State of an input for people, as in the DBC file. */
enum pam_input { PAM_FORBIDS = 0, PAM_PERMITS = 1, PAM_NO_INPUT = 3 };

struct pam_readings {
    int32_t pressure[PAM_CHANNELS];     /* Pa gauge */
    bool pressure_valid[PAM_CHANNELS];  /* false: open, shorted, out of range */
    int32_t angle;                      /* microradians */
    bool angle_valid;
    int32_t supply;                     /* Pa absolute */
    bool supply_valid;                  /* false on a board without this sensor */
    enum pam_input emergency_stop;      /* normally closed contact: no current forbids */
    enum pam_input enabling_switch;     /* normally open contact: no current forbids */
    uint16_t defects;                   /* present PAM_FAULT_SUPPLY, _VALVE, _TEMPERATURE, _INTERNAL */
    bool self_test_passed;              /* `boot` lasts until then */
};

struct pam_outputs {
    int16_t valve[PAM_CHANNELS]; /* fraction of full scale, +-PAM_FULL_SCALE; where `vents` is false */
    bool vents[PAM_CHANNELS];    /* the valve opens its exhaust: no current */
    bool release_brake;          /* false: no current, the brake holds */
    bool close_dump;             /* false: no current, the dump valve is open */
};

/* The six functions of the hardware. None of them may wait. */
struct pam_hardware {
    void *context; /* first argument of each function */
    /* Microseconds from any moment on; begins again at 0 after 2^32. Never stops, never jumps. */
    uint32_t (*time_us)(void *context);
    /* Takes the oldest frame received with an 11-bit identifier; false if there is none. */
    bool (*receive)(void *context, struct pam_frame *frame);
    /* Queues a frame; false if the queue is full. */
    bool (*send)(void *context, const struct pam_frame *frame);
    /* The newest readings of all sensors and inputs, sampled together. */
    void (*read)(void *context, struct pam_readings *readings);
    /* Sets all outputs. */
    void (*write)(void *context, const struct pam_outputs *outputs);
    /* Restarts the hardware watchdog of the processor, which resets it after about 50 ms. */
    void (*feed_watchdog)(void *context);
};

struct pam_settings {
    uint8_t number;                      /* of the board on its bus, 0 to 15 */
    bool shares_with_canopen;            /* the second set of identifiers */
    uint32_t boot_us;                    /* least duration of `boot` */
    int32_t max_pressure[PAM_CHANNELS];  /* the board's own limit, Pa gauge */
    uint16_t firmware_version;
};

/* All memory of a board. Its members are private; `pam_board_step` alone changes them. */
struct pam_board {
    struct pam_hardware hardware;
    struct pam_settings settings;
    struct pam_readings readings;
    struct pam_outputs outputs;
    uint8_t state;
    uint8_t state_inverted; /* a copy: memory that has changed by itself is PAM_FAULT_INTERNAL */
    uint16_t faults;
    bool armed;
    bool enabled[PAM_CHANNELS];
    int16_t valve[PAM_CHANNELS];
    bool wants_brake_released;
    bool wants_dump_closed;
    bool has_counter;
    uint8_t counter;
    uint32_t accepted_at; /* when the last valid valve command arrived, us */
    uint16_t rejected_frames;
    uint32_t crc_errors[PAM_CRC_LIMIT]; /* when the last ones arrived, us */
    uint8_t crc_error_count;
    uint8_t crc_error_next;
    bool over_pressure;
    bool sensor_lost;
    uint32_t last_step; /* us */
    uint64_t uptime_us;
    uint64_t due_measurement; /* uptime, us */
    uint64_t due_status;
    uint64_t due_heartbeat;
    uint8_t samples;
    bool has_told;
    uint8_t told_state;
    uint16_t told_faults;
    uint8_t told_inputs;
};

/* Vents all outputs and begins `boot`. */
void pam_board_init(struct pam_board *board, const struct pam_hardware *hardware,
                    const struct pam_settings *settings);

/* One turn: receive, read, judge, set the outputs, send what is due, feed the watchdog. */
void pam_board_step(struct pam_board *board);

/* CRC-8 SAE J1850 over the identifier, low byte first, and the data. */
uint8_t pam_crc8(uint16_t identifier, const uint8_t *data, uint8_t length);

#endif
