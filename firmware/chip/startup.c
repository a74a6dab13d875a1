/* Vectors, memory, and functions that the compiler may call. */
#include "../core/bytes.h"
#include "chip.h"
#include "registers.h"

/* The linker script's; sizes in bytes are symbols' addresses. */
extern uint8_t data_load[], data_start[], data_size[], bss_start[], bss_size[], stack_top[];

void *memcpy(void *to, const void *from, size_t n) {
    uint8_t *d = to;
    const uint8_t *s = from;
    while (n--) *d++ = *s++;
    return to;
}

void *memset(void *to, int value, size_t n) {
    uint8_t *d = to;
    while (n--) *d++ = (uint8_t)value;
    return to;
}

__attribute__((used)) static void begin(void) {
    SYST_CSR = 0; /* whatever the loader has left running */
    NVIC_ICER0 = NVIC_ICER1 = NVIC_ICPR0 = NVIC_ICPR1 = ~(uint32_t)0;
    SCB_VTOR = 0x08003000;
    memcpy(data_start, data_load, (size_t)data_size);
    memset(bss_start, 0, (size_t)bss_size);
    run();
}

/* Whatever stack the loader has left. */
__attribute__((naked)) static void reset(void) { __asm volatile("ldr r0, =stack_top\n msr msp, r0\n b begin\n .ltorg"); }

/* A fault stops everything; the watchdog then resets the chip, and the robot stands still and reports it. */
static void stop(void) {
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static void (*const vectors[16 + 60])(void) = {
    (void (*)(void))(uintptr_t)stack_top, reset, stop, stop, stop, stop, stop, 0, 0, 0, 0, stop, stop, 0, stop, systick_interrupt,
    [16 + IRQ_DMA1_CHANNEL5] = bus_received_interrupt,
    [16 + IRQ_USART1] = bus_interrupt,
    [16 + IRQ_USART3] = pc_interrupt,
    [16 + IRQ_UART5] = zigbee_interrupt};
