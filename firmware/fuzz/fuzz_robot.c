/* libFuzzer: the input is a script of what happens to a robot: bytes and whole frames on the links, presses, faults, servos' answers, tables
   with sums made right. What must hold at every step is asserted. */
#include <stdlib.h>

#include "../core/crc.h"
#include "../tests/sim.h"

#ifndef TABLE_FILE
#error "-DTABLE_FILE=\"...\""
#endif

#define MUST(condition) do { if (!(condition)) abort(); } while (0)

extern const uint8_t fuzz_table[], fuzz_table_end[];
__asm__(".section .rodata\nfuzz_table: .incbin \"" TABLE_FILE "\"\nfuzz_table_end:\n.previous");

struct script {
    const uint8_t *at, *end;
};

static uint8_t next(struct script *s) { return s->at < s->end ? *s->at++ : 0; }

static uint32_t take(struct script *s, uint8_t *to, uint32_t most) {
    uint32_t n = next(s);
    uint32_t there = (uint32_t)(s->end - s->at);
    if (n > most) n = most;
    if (n > there) n = there;
    memcpy(to, s->at, n);
    s->at += n;
    return n;
}

static uint32_t table_bytes(void) { return (uint32_t)(fuzz_table_end - fuzz_table); }

/* The table with some bytes changed and its CRC made right, whole or in parts, as a frame of its own each. */
static void upload(struct sim *sim, struct script *s) {
    static uint8_t table[TABLE_BYTES];
    uint8_t p[FRAME_PAYLOAD];
    uint32_t size = table_bytes(), link = next(s) & 1u, changes = next(s) % 8u, shape = next(s);
    memcpy(table, fuzz_table, size);
    for (uint32_t k = 0; k < changes; k++) {
        uint32_t low = next(s), at = (low | (uint32_t)next(s) << 8) % (size - 4u);
        table[at] = next(s);
    }
    if (!(shape & 1u)) put32(table + size - 4u, crc32(0, table, size - 4u));
    put32(p, size);
    put32(p + 4, crc32(0, table, size));
    p[8] = (shape & 2u) ? next(s) : (uint8_t)(sim->r.upload.accepted + 1u);
    p[9] = (uint8_t)(shape >> 2 & 1u);
    sim_frame(sim, link, FRAME_BEGIN, p, 10);
    for (uint32_t at = 0; at < size; at += 200u) {
        uint32_t n = size - at < 200u ? size - at : 200u;
        put16(p, at);
        memcpy(p + 2, table + at, n);
        if ((shape & 8u) && next(s) % 4u == 0) continue;
        sim_frame(sim, link, FRAME_DATA, p, n + 2u);
    }
    sim_frame(sim, link, FRAME_END, p, 0);
}

/* An upload that says one size and sends another, in order. */
static void flood(struct sim *sim, struct script *s) {
    uint8_t p[FRAME_PAYLOAD] = {0};
    uint32_t said = (next(s) * 32u) % 4800u, sent = (next(s) * 32u) % 6400u;
    put32(p, said);
    p[8] = (uint8_t)(sim->r.upload.accepted + 1u);
    sim_frame(sim, LINK_PC, FRAME_BEGIN, p, 10);
    memset(p, 0x55, sizeof p);
    for (uint32_t at = 0; at < sent; at += 200u) {
        put16(p, at);
        sim_frame(sim, LINK_PC, FRAME_DATA, p, FRAME_PAYLOAD - 2u);
    }
}

static void fault(struct sim *sim, struct script *s) {
    struct sim_servo *v = &sim->servo[next(s) % (sim->joints ? sim->joints : 1u)];
    uint8_t value = next(s);
    switch (next(s) % 12u) {
    case 0: v->mute = value & 1; break;
    case 1: v->twin = value & 1; break;
    case 2: v->overload = value & 1; break;
    case 3: v->heat = value; break;
    case 4: sim->volts = value; break;
    case 5: sim->babble = value & 1; break;
    case 6: sim->glitch = value % 6u; break;
    case 7: v->table[next(s) % DXL_END] = value; break;
    case 8: v->milli = 4000 * value; break;
    case 9: v->held = value & 1; break;
    case 10: v->powered = value & 1; break;
    default: sim->flip_from = sim->flip_to = 20u * value; break;
    }
}

/* More at once than is looked at in one step, or than there is room for. */
static void burst(struct sim *sim, struct script *s) {
    uint8_t bytes[255], n = (uint8_t)take(s, bytes, sizeof bytes), link = next(s) & 1u;
    for (uint32_t times = next(s) % 4u; times < 4u; times++)
        for (uint32_t k = 0; k < n; k++) ring_put(&sim->r.link[link].rx, bytes[k]);
}

static void bridge_packet(struct sim *sim, struct script *s) {
    uint8_t p[BUS_BYTES], parameters[100];
    uint32_t n = take(s, parameters, sizeof parameters);
    p[0] = p[1] = 0xFF;
    p[2] = next(s);
    p[3] = (uint8_t)(n + 2u);
    p[4] = next(s);
    memcpy(p + 5, parameters, n);
    p[5 + n] = dxl_sum(p, n + DXL_OVERHEAD);
    sim_send(sim, LINK_PC, p, n + DXL_OVERHEAD);
}

static void check_upload(const struct upload *u) {
    MUST(u->size <= TABLE_BYTES && u->got <= u->size);
    if (upload_ready(u)) MUST(table_check(u->spare, u->size) == TABLE_OK && table_fits(u->spare, fuzz_table) == TABLE_OK);
}

static void check(const struct sim *sim) {
    const struct robot *r = &sim->r;
    const uint8_t *t = r->upload.active;
    if (r->joints == 0) { /* a broken table is built in */
        MUST(r->state == STATE_STILL || r->state == STATE_LIMP); /* RELEASE is obeyed all the same */
        return;
    }
    MUST(sim->goal_errors == 0 || sim->flip_to); /* of any bounds that a servo may have been given */
    MUST(r->bus.tx_length <= BUS_BYTES && r->bus.expected <= BUS_BYTES && r->bus.rx_length <= BUS_BYTES);
    MUST(table_check(t, table_size(t)) == TABLE_OK && table_fits(t, fuzz_table) == TABLE_OK);
    MUST(r->state <= STATE_BRIDGE && r->reason < REASONS);
    check_upload(&r->upload);
    MUST(r->turn < r->joints && r->joints == table_joints(t));
    MUST(r->state != STATE_PLAY || r->pose <= table_poses(t));
    for (uint32_t j = 0; torque_on(r) && j < r->joints; j++) {
        MUST(r->goals[j] >= table_low(t, j) && r->goals[j] <= table_high(t, j));
        MUST(r->speeds[j] > 0 && (r->state == STATE_PLAY || r->speeds[j] <= RAMP_SPEED));
    }
    for (uint32_t link = 0; link < LINKS; link++) MUST(ring_used(&r->link[link].tx) <= RING_BYTES && ring_used(&r->link[link].rx) <= RING_BYTES);
}

static void one(struct sim *sim, struct script *s) {
    uint8_t bytes[256];
    uint32_t n, link;
    switch (next(s) % 14u) {
    case 0: sim_run(sim, 1u + next(s)); break;
    case 1: n = take(s, bytes, 200); sim_send(sim, next(s) & 1u, bytes, n); break;
    case 2:
        n = take(s, bytes, FRAME_PAYLOAD);
        link = next(s) & 1u;
        sim_frame(sim, link, next(s), bytes, n);
        break;
    case 3: sim_remote(sim, 1u << next(s) % 10u); break;
    case 4: sim_remote(sim, 0); break;
    case 5: sim->r.start_pressed = next(s) & 1; break;
    case 6: upload(sim, s); break;
    case 7: fault(sim, s); break;
    case 8: bridge_packet(sim, s); break;
    case 9: sim_frame(sim, LINK_PC, (uint8_t)(1u + next(s) % 4u), bytes, 0); break;
    case 10: sim_frame(sim, LINK_PC, (uint8_t)(FRAME_BRIDGE + (next(s) & 1u)), bytes, 0); break;
    case 11: sim_run(sim, 4u * next(s)); break;
    case 12: flood(sim, s); break;
    default: burst(sim, s); break;
    }
    for (link = 0; link < LINKS; link++) sim_receive(sim, link, bytes, sizeof bytes);
}

enum { FRESH, RESET, NEUTRAL, PLAYING, LIMP, BRIDGED, BROKEN, BEGINNINGS };

/* Where a script begins; made once, as the walk up to there takes far longer than the script. */
static void begin(struct sim *sim, uint32_t how) {
    static struct sim kept[BEGINNINGS];
    static bool made[BEGINNINGS];
    if (!made[how]) {
        uint32_t size = table_bytes() - (how == BROKEN);
        bool still = how == FRESH || how == RESET || how == BROKEN;
        sim_boot(sim, fuzz_table, size, how == RESET ? REASON_WATCHDOG : REASON_POWER_ON, how);
        for (uint32_t k = 0; !still && k < 200u && sim->r.state != STATE_NEUTRAL; k++) sim_run(sim, 10);
        if (how == PLAYING) sim_frame(sim, LINK_PC, FRAME_PLAY, NULL, 0);
        if (how == LIMP || how == BRIDGED) sim_frame(sim, LINK_PC, FRAME_RELEASE, NULL, 0);
        if (!still) sim_run(sim, 100);
        if (how == BRIDGED) sim_frame(sim, LINK_PC, FRAME_BRIDGE, NULL, 0), sim_run(sim, 20);
        kept[how] = *sim;
        made[how] = true;
    }
    *sim = kept[how]; /* at the same address: what points into it stays right */
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct sim sim;
    struct script s = {data, data + size};
    begin(&sim, next(&s) % BEGINNINGS);
    for (uint32_t k = 0; k < 24u && s.at < s.end; k++) {
        one(&sim, &s);
        check(&sim);
    }
    return 0;
}
