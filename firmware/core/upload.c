#include "upload.h"

#include "crc.h"

void upload_init(struct upload *u, const uint8_t *built_in) {
    u->active = built_in;
    u->spare = u->buffers[0];
    u->state = UPLOAD_IDLE;
    u->sequence_known = false;
}

/* Numbers run on modulo 256; one that is not ahead of the last by less than half the circle has been here before. */
static bool stale(const struct upload *u, uint8_t sequence) {
    uint8_t ahead = (uint8_t)(sequence - u->accepted);
    return u->sequence_known && (ahead == 0 || ahead > 127u);
}

static uint8_t begin(struct upload *u, const struct frame_reader *f, uint8_t link) {
    if (f->length != 10u) return UPLOAD_MALFORMED;
    if (u->state == UPLOAD_RECEIVING && u->link != link) return UPLOAD_BUSY;
    if (u->state == UPLOAD_CHECKING) return UPLOAD_BUSY;
    if (get32(f->payload) > TABLE_BYTES) return UPLOAD_TOO_BIG;
    if (stale(u, f->payload[8])) return UPLOAD_STALE;
    u->size = get32(f->payload);
    u->crc = get32(f->payload + 4);
    u->sequence = f->payload[8];
    u->flags = f->payload[9];
    u->got = u->running = 0;
    u->link = link;
    u->state = UPLOAD_RECEIVING;
    return UPLOAD_OK;
}

static uint8_t data(struct upload *u, const struct frame_reader *f) {
    if (f->length < 3u) return UPLOAD_MALFORMED;
    uint32_t offset = get16(f->payload), n = f->length - 2u;
    if (offset < u->got) return UPLOAD_OK; /* sent twice */
    if (offset > u->got || offset + n > u->size) return UPLOAD_OFFSET;
    memcpy(u->spare + offset, f->payload + 2, n);
    u->running = crc32(u->running, f->payload + 2, n);
    u->got += n;
    return UPLOAD_OK;
}

static uint8_t end(struct upload *u, const struct frame_reader *f) {
    if (u->got != u->size) return UPLOAD_OFFSET;
    u->number = f->number;
    u->checked = 0;
    u->state = UPLOAD_CHECKING;
    return UPLOAD_OK;
}

uint8_t upload_frame(struct upload *u, const struct frame_reader *f, uint8_t link, uint32_t now) {
    u->heard = now;
    if (f->type == FRAME_BEGIN) return begin(u, f, link);
    if (u->state != UPLOAD_RECEIVING || u->link != link) return UPLOAD_NONE;
    return f->type == FRAME_DATA ? data(u, f) : end(u, f);
}

static enum table_fault check_some(struct upload *u) {
    if (u->checked > 0) return table_check_pose(u->spare, u->checked - 1u);
    if (u->running != u->crc || u->crc != CRC32_WITH_ITSELF) return TABLE_CRC;
    enum table_fault fault = table_check_head(u->spare, u->size);
    return fault ? fault : table_fits(u->spare, u->active);
}

bool upload_step(struct upload *u, uint32_t now, uint8_t *result) {
    if (u->state == UPLOAD_RECEIVING && now - u->heard > UPLOAD_SILENCE_MS) u->state = UPLOAD_IDLE;
    if (u->state != UPLOAD_CHECKING) return false;
    enum table_fault fault = check_some(u);
    if (!fault && u->checked++ < table_poses(u->spare)) return false;
    *result = fault ? (uint8_t)(UPLOAD_FAULT + fault) : UPLOAD_OK;
    u->state = fault ? UPLOAD_IDLE : UPLOAD_READY;
    if (!fault) {
        u->accepted = u->sequence;
        u->sequence_known = true;
    }
    return true;
}

void upload_take(struct upload *u) {
    u->active = u->spare;
    u->spare = u->spare == u->buffers[0] ? u->buffers[1] : u->buffers[0];
    u->state = UPLOAD_IDLE;
}

void upload_drop(struct upload *u) { u->state = UPLOAD_IDLE; }
