/* Pins of the CM-530, its START button, lights and battery. */
#include "chip.h"
#include "registers.h"

enum { IN_ANALOG = 0x0, OUT = 0x2, IN = 0x4, IN_PULLED = 0x8, OUT_ALTERNATE = 0xB }; /* OUT: 2 MHz; OUT_ALTERNATE: 50 MHz */

static void mode(volatile uint32_t *control, uint32_t pin, uint32_t kind) {
    uint32_t shift = 4u * (pin % 8u);
    *control = (*control & ~(0xFu << shift)) | kind << shift;
}

static void pin_set(volatile uint32_t *bsrr, uint32_t pin, bool high) { *bsrr = 1u << (high ? pin : pin + 16u); }

void pins_begin(void) {
    AFIO_MAPR = AFIO_MAPR_USART1_REMAP | AFIO_MAPR_SWJ_CFG_NOJTAG; /* PB3 and PB4 are JTAG's at first; SWD stays */
    pin_set(&GPIOB_BSRR, 4, false);
    pin_set(&GPIOB_BSRR, 5, true);       /* the servo bus listens */
    mode(&GPIOB_CRL, 4, OUT);            /* direction: transmit */
    mode(&GPIOB_CRL, 5, OUT);            /* direction: receive */
    pin_set(&GPIOB_BSRR, 7, true);
    mode(&GPIOB_CRL, 6, OUT_ALTERNATE);  /* servo bus */
    mode(&GPIOB_CRL, 7, IN_PULLED);
    pin_set(&GPIOB_BSRR, 3, true);
    mode(&GPIOB_CRL, 3, IN_PULLED);      /* START */
    pin_set(&GPIOB_BSRR, 11, true);
    mode(&GPIOB_CRH, 10, OUT_ALTERNATE); /* PC link */
    mode(&GPIOB_CRH, 11, IN_PULLED);
    pin_set(&GPIOB_BSRR, 13, true);
    pin_set(&GPIOB_BSRR, 15, true);
    pin_set(&GPIOB_BSRR, 12, true);
    pin_set(&GPIOB_BSRR, 14, true);
    mode(&GPIOB_CRH, 12, OUT);           /* lights, on when low: AUX */
    mode(&GPIOB_CRH, 14, OUT);           /* PROGRAM */
    mode(&GPIOB_CRH, 13, OUT);           /* MANAGE */
    mode(&GPIOB_CRH, 15, OUT);           /* PLAY */
    pin_set(&GPIOC_BSRR, 13, false);
    mode(&GPIOC_CRH, 13, OUT);           /* POWER */
    mode(&GPIOC_CRH, 12, OUT_ALTERNATE); /* ZigBee */
    mode(&GPIOD_CRL, 2, IN);
    pin_set(&GPIOA_BSRR, 12, true);
    mode(&GPIOA_CRH, 12, OUT);           /* ZigBee module runs */
    mode(&GPIOC_CRL, 3, IN_ANALOG);      /* battery */
}

bool start_button(void) { return !(GPIOB_IDR & 1u << 3); }

/* PLAY while a table plays; MANAGE while torque is off or nothing is done, and then why: PROGRAM blinks the tens, AUX the ones. */
void show(uint8_t state, uint8_t reason, uint32_t now) {
    bool idle = state == STATE_LIMP || state == STATE_STILL;
    pin_set(&GPIOB_BSRR, 15, state != STATE_PLAY);
    pin_set(&GPIOB_BSRR, 13, !idle);
    pin_set(&GPIOB_BSRR, 14, !(idle && reason_light(reason, now, true)));
    pin_set(&GPIOB_BSRR, 12, !(idle && reason_light(reason, now, false)));
}

void battery_begin(void) {
    ADC1_SMPR1 = 7u << 9; /* channel 13, longest sampling */
    ADC1_SQR3 = 13;
    ADC1_CR2 = ADC_CR2_ADON | ADC_CR2_EXTTRIG | ADC_CR2_EXTSEL_SWSTART;
    ADC1_CR2 |= ADC_CR2_SWSTART;
}

/* The last conversion, and the next is begun. ROBOTIS's example prints the upper 8 of 12 bits as tenths of a volt. */
uint16_t battery_decivolt(void) {
    uint16_t value = robot.battery;
    if (ADC1_SR & ADC_SR_EOC) value = (uint16_t)(ADC1_DR >> 4);
    ADC1_CR2 |= ADC_CR2_SWSTART;
    return value;
}
