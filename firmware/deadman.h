/* Ownership of the commands, and the dead-man timeout. Pure; also built for the host. Times in ticks
   of 4 us. */
#ifndef DEADMAN_H
#define DEADMAN_H

#include <stdbool.h>
#include <stdint.h>

#include "protocol.h"
#include "ticks.h"

#define NO_OWNER 0xFF

typedef struct {
    uint8_t mode;     /* MODE_... of the protocol */
    uint8_t owner;    /* link that owns the commands, or NO_OWNER */
    uint8_t sequence; /* sequence number of the command in force */
    uint8_t foreign;  /* number of commands of a link that does not own them */
    bool pressed;     /* state of the stop button */
    ticks_t commanded; /* when the owner's last valid command arrived */
    ticks_t since;     /* when the command in force took effect */
} deadman_t;

void deadman_begin(deadman_t *deadman);

/* Valid settings are in use: the robot may move. No link owns the commands, so that a link that was
   overruled has to send a stop here too. */
void deadman_ready(deadman_t *deadman);

/* A stop from any link. It claims the commands when no link owns them. From a link that does not own
   them it overrules the owner, which cannot drive until it has sent a stop itself. */
void deadman_stop(deadman_t *deadman, uint8_t link, uint8_t sequence, ticks_t now);

/* A command that sets `mode`; true when it is accepted. */
bool deadman_command(deadman_t *deadman, uint8_t link, uint8_t mode, uint8_t sequence, ticks_t now);

/* True when `link` may change settings: it owns the commands, or no link does. */
bool deadman_allows(const deadman_t *deadman, uint8_t link);

/* Dead-man timeout: an owner silent for `limit` ticks loses the commands. */
void deadman_tick(deadman_t *deadman, ticks_t limit, ticks_t now);

/* Stops until deadman_clear: MODE_FAULT or MODE_BATTERY. */
void deadman_hold(deadman_t *deadman, uint8_t mode);
void deadman_clear(deadman_t *deadman);
void deadman_button(deadman_t *deadman, bool pressed);

/* True while the motors may be driven. */
static inline bool deadman_drives(const deadman_t *deadman)
{
    return deadman->mode == MODE_SPEED || deadman->mode == MODE_DUTY;
}

#endif
