/* A robot of plain servos in microseconds around the core, for thousands of runs: no emulator, no Python in the loop. */
#ifndef SIM_H
#define SIM_H

#include "../core/robot.h"

struct sim_servo {
    uint8_t table[DXL_END];
    int64_t milli; /* position, thousandths of a count */
    bool powered, mute, twin, overload;
    uint32_t boots_until; /* ms: starting, and answers nothing */
    bool level1;          /* answers reads alone */
    uint8_t lead, lacks;  /* stray bytes before each answer; first bytes that each answer lacks */
    bool held;     /* something is in its way: it does not move */
    uint8_t heat, drop; /* deg C; 0.1 V less than the others have */
    uint8_t hangs;      /* counts by which its load holds it below its goal */
};

enum { LOG_GOALS = 1, LOG_OFF = 2, LOG_STATE = 3 };
struct sim_event {
    uint64_t us;
    uint8_t kind, state, reason, servo;
    uint16_t pose, resends;
};
#define SIM_EVENTS 4096u

struct sim {
    struct robot r;
    struct sim_servo servo[MAX_JOINTS];
    uint32_t joints;
    uint64_t us, busy_until, rng;
    uint8_t answer[BUS_BYTES + 16];
    uint32_t answer_length;
    uint32_t flip_to, flip_from; /* of a million bytes */
    uint8_t volts;
    bool babble;
    uint8_t glitch;              /* one answer to spoil: 1 lost, 2 hot, 3 low voltage, 4 overload bit, 5 a flipped bit */
    struct sim_event log[SIM_EVENTS];
    uint32_t events;
    uint32_t poses, goal_errors; /* Sync Writes in play; goals a servo took that were out of the table's bounds */
    uint32_t wrong_since, wrong_longest; /* ms for which some servo's goal was not the one meant */
    uint8_t state_seen;
    void (*sent)(const struct sim *s); /* called at each transaction, where set */
    void (*before)(struct sim *s);     /* before the servos hear a packet; after the answer is there */
    void (*after)(struct sim *s);
    uint32_t transactions, jitter;     /* jitter: us by which answers come later, at most */
};

struct sim *sim_new(void);
void sim_free(struct sim *s);
void sim_boot(struct sim *s, const uint8_t *table, uint32_t size, uint32_t cause, uint64_t seed);
void sim_reset(struct sim *s, const uint8_t *table, uint32_t size, uint32_t cause);
void sim_run(struct sim *s, uint32_t ms);
void sim_send(struct sim *s, uint32_t link, const uint8_t *bytes, uint32_t n);
void sim_put(struct sim *s, uint32_t link, const uint8_t *bytes, uint32_t n);
uint32_t sim_receive(struct sim *s, uint32_t link, uint8_t *to, uint32_t most);
void sim_frame(struct sim *s, uint32_t link, uint32_t type, const uint8_t *payload, uint32_t n);
void sim_remote(struct sim *s, uint32_t buttons);
uint64_t sim_get(struct sim *s, const char *what, uint32_t k);
void sim_set(struct sim *s, const char *what, uint32_t k, uint32_t value);
uint32_t sim_random(struct sim *s, uint32_t below);

#endif
