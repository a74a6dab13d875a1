/* The core and its plain servos on another emulated Cortex-M3 (QEMU's mps2-an385): packets to the servos go to its UART, in hex.
   The same file built for the PC prints the same; so the cross compiler's code behaves as in the native tests. */
#include "sim.h"

extern const uint8_t witness_table[], witness_table_end[];
__asm__(".section .rodata,\"a\"\nwitness_table: .incbin \"" TABLE_FILE "\"\nwitness_table_end:\n.previous");

#ifdef __arm__
#define UART ((volatile uint32_t *)0x40004000)

static void put(char c) {
    while (UART[1] & 1u) {
    }
    UART[0] = (uint32_t)c;
}

static void leave(void) {
    static const uint32_t stopped = 0x20026; /* semihosting: application exit */
    register uint32_t call __asm__("r0") = 0x18, why __asm__("r1") = stopped;
    __asm volatile("bkpt 0xAB" : : "r"(call), "r"(why));
}

void *memcpy(void *to, const void *from, size_t n) {
    for (size_t k = 0; k < n; k++) ((uint8_t *)to)[k] = ((const uint8_t *)from)[k];
    return to;
}

void *memset(void *to, int value, size_t n) {
    for (size_t k = 0; k < n; k++) ((uint8_t *)to)[k] = (uint8_t)value;
    return to;
}
#else
#include <stdio.h>
#include <stdlib.h>
static void put(char c) { putchar(c); }
static void leave(void) { exit(0); }
#endif

static void sent(const struct sim *s) {
    const struct bus *b = &s->r.bus;
    if (b->tx[4] != DXL_SYNC_WRITE) return;
    for (uint32_t k = 0; k < b->tx_length; k++) {
        put("0123456789abcdef"[b->tx[k] >> 4]);
        put("0123456789abcdef"[b->tx[k] & 15]);
    }
    put('\n');
}

static struct sim sim;

int main(void) {
#ifdef __arm__
    UART[2] = 1;
    UART[4] = 16;
#endif
    sim_boot(&sim, witness_table, (uint32_t)(witness_table_end - witness_table), REASON_POWER_ON, 1);
    sim.sent = sent;
    for (uint32_t k = 0; k < 50 && sim.r.state != STATE_NEUTRAL; k++) sim_run(&sim, 50);
    sim_remote(&sim, REMOTE_U);
    sim_remote(&sim, 0);
    sim_run(&sim, 5000);
    sim_remote(&sim, REMOTE_1);
    sim_remote(&sim, 0);
    sim_run(&sim, 100);
    leave();
    return 0;
}

#ifdef __arm__
static void reset(void) { main(); }
__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {(void *)0x20100000, (void *)reset};
#endif
