/* The whole robot as the core knows it. One loop owns it all: the chip wakes it once a millisecond and after each transaction. */
#ifndef ROBOT_H
#define ROBOT_H

#include "bus.h"
#include "dynamixel.h"
#include "frame.h"
#include "remote.h"
#include "table.h"
#include "upload.h"

enum state {
    STATE_STILL,   /* after a reset: nothing is sent but questions; servos do what they did */
    STATE_LIMP,    /* torque is off, and is made sure of */
    STATE_CHECK,   /* every servo is asked before torque goes on */
    STATE_RAMP,    /* slowly to neutral, or to where a table begins */
    STATE_NEUTRAL, /* holds neutral */
    STATE_PLAY,
    STATE_STOP,    /* slowly to neutral, and holds it */
    STATE_YIELD,   /* slowly to neutral, then limp: something is wrong */
    STATE_BRIDGE   /* the PC talks to the servos through us */
};

/* The reason for a state. */
enum reason {
    REASON_NONE, REASON_POWER_ON, REASON_RESET_PIN, REASON_WATCHDOG, REASON_SOFTWARE, REASON_BROWN_OUT, REASON_BUTTON,
    REASON_REMOTE, REASON_LINK, REASON_ENDED, REASON_SILENT, REASON_GARBLED, REASON_WRONG_MODEL, REASON_OVERLOAD, REASON_HOT,
    REASON_LOW_BATTERY, REASON_DEAD_SUPPLY, REASON_BABBLE, REASON_NOT_ARRIVED, REASON_GOAL_REFUSED, REASON_NARROW_LIMITS,
    REASON_HELD, REASON_BRIDGE_SILENT, REASON_BAD_TABLE, REASON_MOVED_BY_HAND, REASON_IDLE, REASONS
};

enum seating { SEAT_NOT, SEAT_ABOVE, SEAT_DONE }; /* how far the last of the way to neutral has come */

enum reaction { GO_ON, YIELD, RELEASE };

struct servo {
    uint16_t position, present_speed, load;
    uint8_t volts, heat, error;
    uint8_t settings[6];   /* margins, slopes, punch as they were when torque went on */
    uint16_t torque_limit; /* what the servo itself begins with: its register of the largest torque */
    bool known;            /* settings and torque limit were read */
    uint8_t missed;        /* rounds without an answer, one after another */
    uint8_t garbled;       /* of those, with something that was none */
    uint8_t hot, overloaded;
    bool verified;         /* was read to have the goal and speed that were sent last */
    bool off;              /* was read to have torque off since it was told */
    bool fresh;            /* answered in this round */
    uint32_t heard;        /* when it answered last [ms] */
};

struct links {
    struct ring rx, tx;
    struct frame_reader reader;
    uint32_t heard;        /* when its last byte came [ms] */
};

enum { LINK_PC, LINK_ZIGBEE, LINKS };

struct bridge {
    uint8_t packet[BUS_BYTES], got;
    bool whole;            /* a packet waits for the bus */
    bool asked;            /* what is under way on the bus is the PC's */
    bool moved;            /* torque or goals went through: silence ends in a ramp */
    bool off;              /* torque was to be off when it began; those that do not hear yet are told again */
    uint32_t heard;
};

struct robot {
    /* between core and chip */
    struct bus bus;
    struct links link[LINKS];
    bool start_pressed;    /* pin of the START button, as it is */
    uint16_t battery;      /* 0.1 V, of the controller's own converter */

    struct upload upload;
    struct remote remote;
    struct bridge bridge;
    struct servo servo[MAX_JOINTS];
    uint16_t goals[MAX_JOINTS], speeds[MAX_JOINTS]; /* what was sent last */
    uint32_t joints;
    uint32_t now, ticked;
    uint32_t began, entered; /* when the program and the present state did [ms] */
    bool running;

    uint8_t state, after, reason, servo_named, cause, table_fault;
    bool state_told;

    uint32_t pose, cycle, next_pose; /* of the table that plays */
    bool stop_asked, ending; /* it is to end with its stop; that plays */
    bool send_goals, send_release, send_limits, send_blank, sending_read;
    bool off_twice;    /* torque off goes out twice in a row: what spoils every other packet spoils one of them */
    bool gentle;       /* the first way to neutral: torque is limited */
    uint8_t came_from; /* the state before CHECK */
    uint8_t resends;
    uint32_t ramp_ends;
    uint8_t seating;

    uint32_t turn, tries, sweep_started, failed_row, garbled_row;
    uint8_t check_for; /* what follows when every servo has been asked: a ramp to hold, or one to let go */
    uint8_t check_pass, low_rounds, dead_rounds;
    bool noise, round_over; /* noise: a try of the present servo was answered by it */
    uint16_t slow_turn;

    uint32_t stray_seen, stray_since;
    uint8_t stray_windows;

    uint32_t pressed_since;
    bool pressed, armed, held_told;
    uint8_t pressed_in; /* state in which the last press began */
};

/* built_in: a whole table. cause: REASON_POWER_ON, or which reset it was. */
void robot_init(struct robot *r, const uint8_t *built_in, uint32_t size, uint8_t cause);

/* To be called after every wake; `now` [ms]. */
void robot_step(struct robot *r, uint32_t now);

/* --- shared by the core's files --- */

static inline bool torque_on(const struct robot *r) { return r->state >= STATE_RAMP && r->state <= STATE_YIELD; }
/* Servos that do not answer may still be starting. */
static inline bool booting(const struct robot *r) { return r->now - r->began < BOOT_MS; }
static inline const uint8_t *playing(const struct robot *r) { return r->upload.active; }

void enter(struct robot *r, uint8_t state, uint8_t reason, uint8_t servo);    /* robot.c */
void begin_play(struct robot *r);
void play_from_neutral(struct robot *r, uint8_t reason);                                             /* motion.c */
void ramp_to(struct robot *r, const uint16_t *goals, uint8_t state, uint8_t after);
void ramp_to_neutral(struct robot *r, uint8_t state, uint8_t after);
bool motion_send(struct robot *r);
void motion_round(struct robot *r);
void release(struct robot *r);
uint16_t torque_limit(const struct robot *r, uint32_t joint);
bool reserved(const struct robot *r, uint32_t ms);
void read_begin(struct robot *r);                                             /* reading.c */
bool read_next(struct robot *r);
void read_answer(struct robot *r);
void react(struct robot *r, uint8_t reason, uint8_t servo);                   /* reactions.c */
enum reaction reaction_of(uint8_t reason);
void judge_round(struct robot *r);
void judge_stray(struct robot *r);
void commands_tick(struct robot *r);                                          /* commands.c */
void commands_bytes(struct robot *r);
void tell_state(struct robot *r);                                             /* telemetry.c */
void tell_log(struct robot *r);
bool reason_light(uint8_t reason, uint32_t now, bool tens);
void bridge_begin(struct robot *r);                                           /* bridge.c */
void bridge_feed(struct robot *r, uint8_t byte);
void bridge_send(struct robot *r);
void bridge_answer(struct robot *r);
void bridge_tick(struct robot *r);
void bridge_end(struct robot *r, uint8_t reason);

#endif
