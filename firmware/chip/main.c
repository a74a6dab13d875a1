/* The CM-530's program: wakes once a millisecond and after each transaction, and lets the core think. */
#include "chip.h"
#include "registers.h"

struct robot robot;
volatile uint32_t milliseconds;

extern const uint8_t built_in_table[];
extern const uint32_t built_in_table_bytes;

void systick_interrupt(void) { milliseconds++; }

static void systick_begin(void) {
    SYST_RVR = 72000u - 1u;
    SYST_CVR = 0;
    SYST_CSR = 7; /* processor clock, interrupt, on */
}

static void every_tick(uint32_t now) {
    watchdog_feed();
    robot.start_pressed = start_button();
    if (bus_expired(&robot.bus, now)) bus_stop_waiting();
}

static void seldom(void) {
    robot.battery = battery_decivolt();
    show(robot.state, robot.reason, milliseconds);
}

/* Asleep until an interrupt; one that came since the last look is seen, as it stays pending while interrupts are masked. */
static void sleep_until_needed(uint32_t seen) {
    __asm volatile("cpsid i" ::: "memory");
    bool idle = milliseconds == seen && !robot.bus.done && !ring_used(&robot.link[LINK_PC].rx) && !ring_used(&robot.link[LINK_ZIGBEE].rx);
    if (idle) __asm volatile("wfi" ::: "memory");
    __asm volatile("cpsie i" ::: "memory");
}

void run(void) {
    watchdog_begin();
    uint8_t cause = reset_cause();
    clock_begin();
    pins_begin();
    bus_begin();
    links_begin();
    battery_begin();
    robot_init(&robot, built_in_table, built_in_table_bytes, cause);
    systick_begin();
    uint32_t seen = 0;
    for (;;) {
        uint32_t now = milliseconds;
        if (now != seen) every_tick(now);
        robot_step(&robot, now);
        if (robot.bus.start) bus_start();
        links_send();
        if (now != seen && now % 128u == 0) seldom();
        seen = now;
        sleep_until_needed(seen);
    }
}
