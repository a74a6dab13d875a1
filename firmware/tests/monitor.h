/* Judges a robot from outside, whoever moves it, the controller's program or the host's player: what its servos hold and do, and what people
   and the PC asked for. It knows nothing of either program, of their states, or of the simulation, and includes nothing of them. Times in
   ms, positions in counts of the servo. */
#ifndef MONITOR_H
#define MONITOR_H

#include <stdbool.h>
#include <stdint.h>

#define MONITOR_JOINTS 26u

enum monitor_asked { ASKED_GO = 1, ASKED_STOP = 2, ASKED_RELEASE = 4, ASKED_RESET = 8 };
enum monitor_rule {
    RULE_NONE,
    RULE_TORQUE_RETURNED,  /* after a release torque came on, and nobody had pressed a button or sent PLAY */
    RULE_HELD_ON,          /* 50 ms after a release a servo still had torque */
    RULE_MOVED_AFTER_STOP, /* later than 50 ms after a stop there was a new goal, away from neutral or faster than a ramp */
    RULE_BOUNDS,           /* a goal out of bounds */
    RULE_SPEED,            /* a goal with no speed limit, or above the joint's */
    RULE_FIRST_TORQUE,     /* torque came on with full force or faster than a ramp */
    RULE_NOT_FOUND,        /* a silent, hot or overloaded servo, and 0.4 s later the robot still moved; or 12 s later it still had torque */
    RULES
};

struct monitor_joint {
    uint16_t low, high, fastest, neutral;  /* what it is allowed: bounds, speed, */
    uint16_t ramp, half, near;             /* speed of a ramp, torque limit of the first one, and distance from neutral that is none */
    bool torque, answers, hot, overloaded; /* as they truly are; answers: could be understood */
    bool hears;                            /* has power and has started */
    uint16_t goal, speed, limit;           /* its registers */
};

struct monitor {
    uint32_t joints, rule, rule_at, rule_joint;
    struct monitor_joint joint[MONITOR_JOINTS];
    bool deaf;                             /* the bus is noise: nobody can hear anything */
    bool raw;                              /* the PC itself talks to the servos */
    /* the monitor's own */
    uint32_t bad_since[MONITOR_JOINTS], release_at, stop_at, reset_at, go_at, deaf_since;
    uint32_t hears_since[MONITOR_JOINTS];
    uint16_t goal_before[MONITOR_JOINTS];
    bool before[MONITOR_JOINTS], yields[MONITOR_JOINTS], allowed, released, any_before;
};

void monitor_begin(struct monitor *m, uint32_t joints, bool power_on);

/* One millisecond has gone by; `joint` is up to date. asked: requests that reached the robot in it. */
void monitor_look(struct monitor *m, uint32_t ms, uint32_t asked);

#endif
