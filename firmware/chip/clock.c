/* 72 MHz from the 8 MHz crystal, the watchdog, and why we woke. */
#include "chip.h"
#include "registers.h"

static void wait(const volatile uint32_t *where, uint32_t mask, uint32_t value) {
    while ((*where & mask) != value) { /* a crystal that does not start: the watchdog runs already */
    }
}

void clock_begin(void) {
    RCC_CR |= RCC_CR_HSION; /* the loader may have the PLL on, and that takes no new factor while it runs */
    RCC_CFGR = 0;
    wait(&RCC_CFGR, RCC_CFGR_SWS, 0);
    RCC_CR &= ~(uint32_t)RCC_CR_PLLON;
    RCC_CR |= RCC_CR_HSEON;
    wait(&RCC_CR, RCC_CR_HSERDY, RCC_CR_HSERDY);
    FLASH_ACR = 0x12; /* two wait states, prefetch */
    RCC_CFGR = RCC_CFGR_PLLMUL_9 | RCC_CFGR_PLLSRC_HSE | RCC_CFGR_PPRE1_2 | RCC_CFGR_ADCPRE_6;
    RCC_CR |= RCC_CR_PLLON;
    wait(&RCC_CR, RCC_CR_PLLRDY, RCC_CR_PLLRDY);
    RCC_CFGR |= RCC_CFGR_SW_PLL;
    wait(&RCC_CFGR, RCC_CFGR_SWS, RCC_CFGR_SWS_PLL);
    RCC_AHBENR |= RCC_AHBENR_DMA1EN; /* the loader need not have switched on anything */
    RCC_APB2ENR |= RCC_APB2ENR_AFIOEN | RCC_APB2ENR_IOPAEN | RCC_APB2ENR_IOPBEN | RCC_APB2ENR_IOPCEN | RCC_APB2ENR_IOPDEN |
                   RCC_APB2ENR_ADC1EN | RCC_APB2ENR_USART1EN;
    RCC_APB1ENR |= RCC_APB1ENR_USART3EN | RCC_APB1ENR_UART5EN;
}

/* 40 kHz / 32 * 125: resets after 100 ms without food (67 to 133 ms, as that oscillator is rough). */
void watchdog_begin(void) {
    IWDG_KR = 0x5555;
    IWDG_PR = 3;
    IWDG_RLR = 125;
    IWDG_KR = 0xAAAA;
    IWDG_KR = 0xCCCC;
}

void watchdog_feed(void) { IWDG_KR = 0xAAAA; }

#define MARK 0x57424B31u

/* Memory that start-up leaves alone, and the loader too, as far from both ends: the mark is still there after a reset or a short
   dip of the supply, not after power off. */
__attribute__((section(".keep"))) static uint32_t mark, mark_complement;

uint8_t reset_cause(void) {
    uint32_t flags = RCC_CSR;
    bool kept = mark == MARK && mark_complement == ~MARK;
    RCC_CSR |= RCC_CSR_RMVF;
    mark = MARK;
    mark_complement = ~MARK;
    if (flags & (RCC_CSR_IWDGRSTF | RCC_CSR_WWDGRSTF)) return REASON_WATCHDOG;
    if (flags & RCC_CSR_SFTRSTF) return REASON_SOFTWARE;
    if (!kept) return REASON_POWER_ON;
    return flags & RCC_CSR_PORRSTF ? REASON_BROWN_OUT : REASON_RESET_PIN;
}
