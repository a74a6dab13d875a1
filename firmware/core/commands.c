/* What people and the PC want: START button, remote, frames on the links. */
#include "robot.h"

static void start(struct robot *r, uint8_t reason) {
    if (r->joints == 0) return;
    if (r->state == STATE_STILL || r->state == STATE_LIMP) enter(r, STATE_CHECK, reason, 0xFF);
    if (r->state != STATE_NEUTRAL) return;
    play_from_neutral(r, reason);
}

/* A stop starts nothing: where nothing moves it does nothing, and a check that would lead to a ramp is given up. */
static void stop(struct robot *r, uint8_t reason) {
    if (r->state == STATE_CHECK && r->check_for == STATE_RAMP)
        enter(r, r->came_from == STATE_STILL ? STATE_STILL : STATE_LIMP, reason, 0xFF);
    bool sent = r->state == STATE_PLAY && (r->pose || r->cycle);
    if (sent && table_stop(playing(r)) && !r->stop_asked) { /* it has an end of its own; asked a second time it ends at once */
        r->stop_asked = true;
        r->reason = reason;
        r->state_told = false;
        return;
    }
    if (r->state != STATE_PLAY && !(r->state == STATE_RAMP && r->after == STATE_PLAY)) return;
    r->reason = reason;
    ramp_to_neutral(r, STATE_STOP, STATE_NEUTRAL);
}

/* Whether a press that ends now may start something: only where it began in the same state, as a person who presses START while the
   robot moves wants it to stop, and may let go after it has gone limp. */
static bool began_here(const struct robot *r) {
    return r->pressed_in == r->state || (!torque_on(r) && (r->pressed_in == STATE_STILL || r->pressed_in == STATE_LIMP));
}

/* The button acts when it is let go; held, it releases. One that was down when power came is not believed before it was up. */
static void button(struct robot *r) {
    if (r->start_pressed != r->pressed) {
        r->pressed = r->start_pressed;
        uint32_t lasted = r->now - r->pressed_since;
        r->pressed_since = r->now;
        if (!r->pressed && r->armed && !r->held_told && lasted >= BUTTON_MS) {
            if (r->state == STATE_PLAY) stop(r, REASON_BUTTON);
            else if (began_here(r)) start(r, REASON_BUTTON);
        }
        r->pressed_in = (uint8_t)r->state;
        r->held_told = false;
        return;
    }
    uint32_t lasted = r->now - r->pressed_since;
    if (!r->pressed && lasted >= BUTTON_MS) r->armed = true;
    if (r->pressed && r->armed && lasted >= HELD_MS && !r->held_told) {
        r->held_told = true;
        react(r, REASON_HELD, 0xFF);
    }
}

/* Torque off once more, where a servo is not known to have heard it; without a table none is. */
static void off_again(struct robot *r) {
    bool known = r->joints > 0;
    for (uint32_t j = 0; j < r->joints; j++) known = known && r->servo[j].off;
    if (!known) r->send_release = true;
}

void commands_tick(struct robot *r) {
    button(r);
    if (r->state == STATE_LIMP && r->now % OFF_AGAIN_MS == 0) off_again(r);
    bool waits = r->state == STATE_NEUTRAL || (r->state == STATE_STILL && r->joints);
    if (waits && r->now - r->entered >= IDLE_MS) react(r, REASON_IDLE, 0xFF);
}

static void result(struct robot *r, uint8_t link, uint8_t code) {
    const struct frame_reader *f = &r->link[link].reader;
    uint8_t payload[5] = {f->type, code, 0, 0, r->upload.sequence};
    put16(payload + 2, r->upload.got);
    frame_send(&r->link[link].tx, FRAME_ANSWER, f->number, payload, 5);
}

static void upload(struct robot *r, uint8_t link) {
    const struct frame_reader *f = &r->link[link].reader;
    uint8_t code = r->joints ? upload_frame(&r->upload, f, link, r->now) : UPLOAD_NONE;
    bool later = f->type == FRAME_END && code == UPLOAD_OK; /* answered when it has been checked */
    bool quiet = f->type == FRAME_DATA && code == UPLOAD_OK;
    if (!later && !quiet) result(r, link, code);
}

static void bridge_wanted(struct robot *r, uint8_t link) {
    bool may = link == LINK_PC && !torque_on(r) && r->joints;
    result(r, link, may ? UPLOAD_OK : UPLOAD_BUSY);
    if (may) bridge_begin(r);
}

static void order(struct robot *r, uint8_t link, uint8_t type) {
    switch (type) {
    case FRAME_ASK:
        r->state_told = false;
        break;
    case FRAME_PLAY:
        start(r, REASON_LINK);
        break;
    case FRAME_STOP:
        stop(r, REASON_LINK);
        break;
    case FRAME_RELEASE:
        enter(r, STATE_LIMP, REASON_LINK, 0xFF);
        break;
    case FRAME_BRIDGE_END:
        if (r->state == STATE_BRIDGE) bridge_end(r, REASON_LINK);
        break;
    default:
        return;
    }
    result(r, link, UPLOAD_OK);
}

static void frame(struct robot *r, uint8_t link) {
    uint8_t type = r->link[link].reader.type;
    if (type == FRAME_BEGIN || type == FRAME_DATA || type == FRAME_END)
        upload(r, link);
    else if (type == FRAME_BRIDGE)
        bridge_wanted(r, link);
    else
        order(r, link, type);
}

static void remote(struct robot *r, uint8_t byte) {
    uint16_t pressed = remote_feed(&r->remote, byte, r->now);
    if (pressed == REMOTE_6) enter(r, STATE_LIMP, REASON_REMOTE, 0xFF);
    if (r->state == STATE_BRIDGE) return;
    if (pressed == REMOTE_U) start(r, REASON_REMOTE);
    if (pressed == REMOTE_1 && (r->state == STATE_STILL || r->state == STATE_LIMP)) start(r, REASON_REMOTE); /* neutral, by a person */
    else if (pressed == REMOTE_1) stop(r, REASON_REMOTE);
}

/* Some bytes of each link at each wake, so that no pose has to wait for a long message. */
void commands_bytes(struct robot *r) {
    for (uint8_t link = 0; link < LINKS; link++) {
        struct links *l = &r->link[link];
        bool gap = r->now - l->heard > FRAME_MS;
        if (ring_used(&l->rx)) {
            if (gap) frame_reset(&l->reader);
            l->heard = r->now;
        }
        for (uint32_t k = 0; k < 16u && ring_used(&l->rx); k++) {
            bool bridged = link == LINK_PC && r->state == STATE_BRIDGE;
            if (bridged && r->bridge.whole) break;
            uint8_t byte = ring_get(&l->rx);
            if (link == LINK_ZIGBEE) remote(r, byte);
            if (bridged) bridge_feed(r, byte);
            if (!frame_feed(&l->reader, byte)) continue;
            if (!bridged || l->reader.type == FRAME_BRIDGE_END) frame(r, link);
        }
    }
}
