/* A table that comes in over a link while another plays: two buffers, offsets in order, CRC, sequence number. */
#ifndef UPLOAD_H
#define UPLOAD_H

#include "frame.h"
#include "table.h"

enum upload_result { UPLOAD_OK, UPLOAD_BUSY, UPLOAD_NONE, UPLOAD_OFFSET, UPLOAD_STALE, UPLOAD_TOO_BIG, UPLOAD_MALFORMED, UPLOAD_FAULT = 0x10 };
enum upload_state { UPLOAD_IDLE, UPLOAD_RECEIVING, UPLOAD_CHECKING, UPLOAD_READY };
#define UPLOAD_RAMPS 1u /* flag of BEGIN: where the first pose is out of reach, ramp to the table's last pose first */

struct upload {
    uint8_t buffers[2][TABLE_BYTES];
    const uint8_t *active;  /* the table that plays: built in, or one of the buffers */
    uint8_t *spare;
    uint32_t size, got, crc, running, heard, checked;
    uint8_t state, link, sequence, flags, number;
    bool sequence_known;
    uint8_t accepted;       /* sequence number of the last table taken */
};

void upload_init(struct upload *u, const uint8_t *built_in);

/* Takes a BEGIN, DATA or END frame of link `link`. Returns UPLOAD_OK or an error; END is answered by upload_step. */
uint8_t upload_frame(struct upload *u, const struct frame_reader *f, uint8_t link, uint32_t now);

/* A little of the work that is left; true when an END has its answer, in *result. */
bool upload_step(struct upload *u, uint32_t now, uint8_t *result);

static inline bool upload_ready(const struct upload *u) { return u->state == UPLOAD_READY; }

/* The table that lies ready becomes the active one. */
void upload_take(struct upload *u);

/* The table that lies ready is dropped. */
void upload_drop(struct upload *u);

#endif
