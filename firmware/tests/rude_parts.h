/* Shared by the files of the rude sessions. */
#ifndef RUDE_PARTS_H
#define RUDE_PARTS_H

#include "rude.h"

enum act { DO_PLAY, DO_STOP, DO_RELEASE, DO_ASK, DO_U, DO_ONE, DO_SIX, DO_DOWN, DO_UP, DO_BEGIN, DO_PART, DO_END, DO_BRIDGE, DO_LIMITS,
           DO_GOALS };
struct step { uint16_t ms; uint8_t act, argument; };

/* One session at a time; the simulation's callbacks find it here. */
struct rude_state {
    struct sim sim;
    struct rude_run *run;
    uint32_t asked, held_from, reset_at;
    bool link_cut, link_flip, pressed, press_counts;
};
extern struct rude_state rude;
extern const struct step rude_steps[RUDE_SESSIONS][13];

static inline uint32_t rude_ms(void) { return (uint32_t)(rude.sim.us / 1000u); }

void rude_order(uint8_t type, uint32_t what);     /* a frame of the PC; its meaning to the monitor */
void rude_remote(uint32_t buttons, uint32_t what);
void rude_press(bool down);
void rude_act(const struct step *s);

#endif
