/* The servo bus: USART1 at 1 Mbit/s, half duplex by two direction pins, bytes moved by DMA in both directions. */
#include "chip.h"
#include "registers.h"

#define BUS_BRR 72u /* 72 MHz / 1 Mbit/s */
#define LISTEN (1u << (4 + 16) | 1u << 5)
#define TALK (1u << (5 + 16) | 1u << 4)
#define ON (USART_CR1_UE | USART_CR1_TE | USART_CR1_RE)

void bus_begin(void) {
    USART1_BRR = BUS_BRR;
    USART1_CR3 = USART_CR3_DMAT;
    USART1_CR1 = ON | USART_CR1_RXNEIE;
    DMA1_CPAR4 = (uint32_t)(uintptr_t)&USART1_DR;
    DMA1_CPAR5 = (uint32_t)(uintptr_t)&USART1_DR;
    NVIC_ISER0 = 1u << IRQ_DMA1_CHANNEL5;
    NVIC_ISER1 = 1u << (IRQ_USART1 - 32);
}

/* The core has asked for a transaction: out with the bytes; the end of the last stop bit interrupts. */
void bus_start(void) {
    struct bus *b = &robot.bus;
    b->start = false;
    b->busy = true;
    USART1_CR1 = ON;
    GPIOB_BSRR = TALK;
    USART1_SR = ~(uint32_t)USART_SR_TC;
    DMA1_IFCR = DMA_IFCR_CGIF4;
    DMA1_CMAR4 = (uint32_t)(uintptr_t)b->tx;
    DMA1_CNDTR4 = b->tx_length;
    DMA1_CCR4 = DMA_CCR_MINC | DMA_CCR_DIR | DMA_CCR_EN;
    USART1_CR1 = ON | USART_CR1_TCIE;
}

static uint32_t more; /* bytes beyond those expected, as stray ones came first */

static void over(uint32_t received) {
    robot.bus.rx_length = (uint16_t)received;
    robot.bus.busy = false;
    robot.bus.done = true;
    USART1_CR3 = USART_CR3_DMAT;
    USART1_CR1 = ON | USART_CR1_RXNEIE; /* what comes now, nobody asked for */
}

static void receive(uint8_t *to, uint32_t count) {
    DMA1_IFCR = DMA_IFCR_CGIF5;
    DMA1_CMAR5 = (uint32_t)(uintptr_t)to;
    DMA1_CNDTR5 = count;
    DMA1_CCR5 = DMA_CCR_MINC | DMA_CCR_TCIE | DMA_CCR_EN;
}

static void sent(void) {
    struct bus *b = &robot.bus;
    GPIOB_BSRR = LISTEN;
    DMA1_CCR4 = 0;
    USART1_CR1 = ON;
    (void)USART1_SR;
    (void)USART1_DR; /* whatever the receiver made of our own bytes */
    if (b->expected == 0) {
        over(0);
        return;
    }
    more = 0;
    receive(b->rx, b->expected);
    USART1_CR3 = USART_CR3_DMAT | USART_CR3_DMAR;
}

void bus_interrupt(void) {
    uint32_t status = USART1_SR, enabled = USART1_CR1;
    if ((enabled & USART_CR1_TCIE) && (status & USART_SR_TC)) {
        sent();
    } else if (status & (USART_SR_RXNE | USART_SR_ORE)) {
        (void)USART1_DR; /* takes an overrun away as well, which would interrupt for ever */
        if (enabled & USART_CR1_RXNEIE) robot.bus.stray++;
    }
}

void bus_received_interrupt(void) {
    DMA1_CCR5 = 0;
    DMA1_IFCR = DMA_IFCR_CGIF5;
    if (!robot.bus.busy) return;
    uint32_t lead = more ? 0 : bus_more(&robot.bus);
    if (lead) {
        more = lead; /* the answer's end is still to come; the next byte takes 10 us */
        receive(robot.bus.rx + robot.bus.expected, lead);
    } else {
        over(robot.bus.expected + more);
    }
}

/* The core stops waiting: the bytes received so far are the answer. Called from the main loop; the interrupt may have been first. */
void bus_stop_waiting(void) {
    DMA1_CCR5 = 0;
    if (!robot.bus.busy) return;
    DMA1_IFCR = DMA_IFCR_CGIF5;
    over(robot.bus.expected + more - DMA1_CNDTR5);
}
