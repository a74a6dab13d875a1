/* PC link (USART3) and ZigBee (UART5) at 57,600 bit/s, both clocked with 36 MHz. */
#include "chip.h"
#include "registers.h"

#define LINK_BRR 625u
#define ON (USART_CR1_UE | USART_CR1_TE | USART_CR1_RE | USART_CR1_RXNEIE)

static uint32_t sending; /* bytes that the DMA of the PC link is at */

void links_begin(void) {
    USART3_BRR = LINK_BRR;
    USART3_CR3 = USART_CR3_DMAT;
    USART3_CR1 = ON;
    DMA1_CPAR2 = (uint32_t)(uintptr_t)&USART3_DR;
    UART5_BRR = LINK_BRR;
    UART5_CR1 = ON;
    NVIC_ISER1 = 1u << (IRQ_USART3 - 32) | 1u << (IRQ_UART5 - 32);
}

/* An overrun without a byte interrupts for ever unless the register is read. */
static void take(uint32_t status, volatile const uint32_t *data, struct ring *in) {
    if (!(status & (USART_SR_RXNE | USART_SR_ORE))) return;
    uint8_t byte = (uint8_t)*data;
    if (status & USART_SR_RXNE) ring_put(in, byte);
}

void pc_interrupt(void) { take(USART3_SR, &USART3_DR, &robot.link[LINK_PC].rx); }

void zigbee_interrupt(void) {
    uint32_t status = UART5_SR;
    struct ring *out = &robot.link[LINK_ZIGBEE].tx;
    take(status, &UART5_DR, &robot.link[LINK_ZIGBEE].rx);
    if (!(UART5_CR1 & USART_CR1_TXEIE) || !(status & USART_SR_TXE)) return;
    if (ring_used(out)) UART5_DR = ring_get(out);
    else UART5_CR1 = ON;
}

/* Hands what waits to the hardware; called from the main loop. */
void links_send(void) {
    struct ring *out = &robot.link[LINK_PC].tx;
    if (sending) {
        if (!(DMA1_ISR & DMA_ISR_TCIF2)) return;
        out->out += sending;
        sending = 0;
        DMA1_CCR2 = 0;
    }
    if (ring_used(out)) {
        uint32_t first = out->out % RING_BYTES, n = ring_used(out);
        sending = n < RING_BYTES - first ? n : RING_BYTES - first;
        DMA1_IFCR = DMA_IFCR_CGIF2;
        DMA1_CMAR2 = (uint32_t)(uintptr_t)(out->bytes + first);
        DMA1_CNDTR2 = sending;
        DMA1_CCR2 = DMA_CCR_MINC | DMA_CCR_DIR | DMA_CCR_EN;
    }
    if (ring_used(&robot.link[LINK_ZIGBEE].tx)) UART5_CR1 = ON | USART_CR1_TXEIE;
}
