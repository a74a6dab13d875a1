/* Functions that the chip provides to the core. */
#ifndef CHIP_H
#define CHIP_H

#include "../core/robot.h"

extern struct robot robot;
extern volatile uint32_t milliseconds;

void run(void) __attribute__((noreturn));  /* main.c */
void systick_interrupt(void);

void clock_begin(void);                    /* clock.c */
void watchdog_begin(void);
void watchdog_feed(void);
uint8_t reset_cause(void);

void pins_begin(void);                     /* pins.c */
bool start_button(void);
void show(uint8_t state, uint8_t reason, uint32_t now);
void battery_begin(void);
uint16_t battery_decivolt(void);

void bus_begin(void);                      /* servo_bus.c */
void bus_start(void);
void bus_stop_waiting(void);
void bus_interrupt(void);
void bus_received_interrupt(void);

void links_begin(void);                    /* links.c */
void links_send(void);
void pc_interrupt(void);
void zigbee_interrupt(void);

#endif
