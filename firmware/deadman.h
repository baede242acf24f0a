/* Who may move the robot, and for how long. Pure; also built for the host. Times in ticks of 4 us. */
#ifndef DEADMAN_H
#define DEADMAN_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"
#include "ticks.h"

#define NOBODY 0xFF

typedef struct {
    uint8_t mode;     /* MODE_... of the protocol */
    uint8_t owner;    /* link, or NOBODY */
    uint8_t sequence; /* number of the command in force */
    uint8_t foreign;  /* commands of a link that did not own them */
    bool pressed;     /* the stop button, now */
    ticks_t heard;   /* when the owner's last valid command came */
    ticks_t since;   /* when the command in force took hold */
} deadman_t;

void deadman_begin(deadman_t *deadman);

/* Valid settings are in use: the robot may move from now on. */
void deadman_ready(deadman_t *deadman);

/* A stop from any link. It claims the commands when nobody owns them; from a link that does not
   own them it holds the robot until the owner has sent a stop itself. */
void deadman_stop(deadman_t *deadman, uint8_t link, uint8_t sequence, ticks_t now);

/* A command that would set `mode`; true when it is to be obeyed. */
bool deadman_command(deadman_t *deadman, uint8_t link, uint8_t mode, uint8_t sequence, ticks_t now);

/* True when `link` may change what does not move: it owns the commands, or nobody does. */
bool deadman_allows(const deadman_t *deadman, uint8_t link);

/* The passing of time: an owner silent for `limit` ticks loses the commands. */
void deadman_tick(deadman_t *deadman, ticks_t limit, ticks_t now);

void deadman_fault(deadman_t *deadman);
void deadman_clear(deadman_t *deadman);
void deadman_button(deadman_t *deadman, bool pressed);

/* True while the motors may have power. */
static inline bool deadman_drives(const deadman_t *deadman)
{
    return deadman->mode == MODE_SPEED || deadman->mode == MODE_DUTY;
}

#endif
