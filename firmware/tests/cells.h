#ifndef CELLS_H
#define CELLS_H

#include "sim.h"

enum fault {
    FAULT_NONE, FAULT_SILENT, FAULT_TWIN, FAULT_MODEL, FAULT_OVERLOAD, FAULT_HOT, FAULT_LOW_BATTERY, FAULT_DEAD_SUPPLY,
    FAULT_CHECKSUM, FAULT_BABBLE, FAULT_CUT_UPLOAD, FAULT_FOREIGN_UPLOAD, FAULT_STALLED_UPLOAD, FAULT_RADIO, FAULT_HELD,
    FAULT_REMOTE_HELD, FAULT_PC_GONE, FAULT_PC_GONE_BRIDGE, FAULT_BROWN_OUT, FAULT_HANG, FAULT_GLITCHES
};

struct cell_run {
    const uint8_t *table;
    uint32_t size, fault, watch_ms;
    uint64_t seed;
    /* results */
    uint32_t servo, servo_id, state, reason, servo_named, poses, limp;
    uint64_t fault_us, ramp_us, off_us; /* from the fault to the first ramp and the first torque-off; UINT64_MAX: none */
};

/* 0: run; 1: the robot did not even start to walk. */
int cell_run(struct sim *s, struct cell_run *c);

#endif
