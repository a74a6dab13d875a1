/* Counts cycles at each block of code and stops the engine where something is due: the same as Cycles._block in cycles.py. */
#include <stdint.h>

struct cycles {
    int64_t now, limit;
    int32_t wish, primask;
    int (*stop)(void *engine);
    int (*read)(void *engine, int number, void *value);
};

void on_block(void *engine, uint64_t address, uint32_t size, struct cycles *c) {
    uint64_t masked = 0;
    (void)address;
    c->now += size > 1 ? size / 2 : 1;
    if (c->wish) c->read(engine, c->primask, &masked);
    if (c->now < c->limit && (!c->wish || masked)) return;
    c->wish = 0;
    c->stop(engine);
}
