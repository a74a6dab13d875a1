/* Rude partners: whole sessions in which the k-th transaction on the servo bus, or something at that time, fails. */
#ifndef RUDE_H
#define RUDE_H

#include "monitor.h"
#include "sim.h"

enum rude_fault {
    RUDE_NOTHING, RUDE_ANSWER_LOST, RUDE_STRAY_BYTES, RUDE_FIRST_BYTE_LOST, RUDE_ANSWER_FLIPPED, RUDE_ANSWER_CUT, RUDE_PACKET_LOST,
    RUDE_PACKET_FLIPPED, RUDE_LATE_ANSWER, RUDE_TEN_LOST, RUDE_UNPLUGGED, RUDE_HALF_UNPLUGGED, RUDE_RESTARTED, RUDE_SUPPLY_DIP,
    RUDE_SUPPLY_GONE, RUDE_LEVEL_1, RUDE_TWIN, RUDE_HOT, RUDE_OVERLOAD, RUDE_LOW, RUDE_BABBLE, RUDE_WATCHDOG, RUDE_MODE,
    RUDE_BROWN_OUT, RUDE_BLOCKED, RUDE_SLOW, RUDE_LINK_FLIPPED, RUDE_LINK_CUT, RUDE_STOP, RUDE_RELEASE, RUDE_PLAY, RUDE_REMOTE_1,
    RUDE_REMOTE_6, RUDE_TAP, RUDE_HELD, RUDE_LATE_BOOT, RUDE_HOT_AFTER_RESET,
    RUDE_FAULTS
};
enum rude_mode { RUDE_ONCE, RUDE_FROM_THEN_ON, RUDE_AGAIN_AND_AGAIN, RUDE_MODES };
enum rude_session { RUDE_WALK_AND_STOP, RUDE_UPLOAD_AND_RELEASE, RUDE_BY_REMOTE, RUDE_BY_BUTTON, RUDE_BRIDGED, RUDE_TO_THE_END, RUDE_SESSIONS };

struct rude_run {
    const uint8_t *table, *second;     /* built in; uploaded */
    uint32_t size, second_size, session, fault, k, mode;
    uint64_t seed;
    /* results */
    uint32_t transactions, rule, rule_at, rule_joint, state, reason, ended_ms;
    bool asked_state_answered, injected;
};

void rude_run(struct rude_run *run);

#endif
