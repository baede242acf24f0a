#include "deadman.h"

void deadman_begin(deadman_t *deadman)
{
    *deadman = (deadman_t){.mode = MODE_UNSET, .owner = NO_OWNER};
}

/* Ends a hold, unless the stop button is pressed. */
static void stand(deadman_t *deadman)
{
    deadman->mode = deadman->pressed ? MODE_BUTTON : MODE_STOPPED;
}

void deadman_ready(deadman_t *deadman)
{
    stand(deadman);
    deadman->owner = NO_OWNER;
}

bool deadman_allows(const deadman_t *deadman, uint8_t link)
{
    return deadman->owner == NO_OWNER || deadman->owner == link;
}

/* True in a mode that only deadman_clear ends. */
static bool is_held(const deadman_t *deadman)
{
    return deadman->mode == MODE_FAULT || deadman->mode == MODE_BATTERY;
}

void deadman_stop(deadman_t *deadman, uint8_t link, uint8_t sequence, ticks_t now)
{
    bool allowed = deadman_allows(deadman, link);
    deadman->sequence = sequence;
    deadman->since = now;
    if (allowed) {
        deadman->owner = link;
        deadman->commanded = now;
    }
    if (deadman->mode == MODE_UNSET || is_held(deadman) || deadman->pressed)
        return;
    deadman->mode = allowed ? MODE_STOPPED : MODE_OVERRULED;
}

bool deadman_command(deadman_t *deadman, uint8_t link, uint8_t mode, uint8_t sequence, ticks_t now)
{
    if (deadman->owner != link) {
        if (deadman->foreign != UINT8_MAX)
            deadman->foreign++;
        return false;
    }
    deadman->commanded = now;
    if (deadman->mode != MODE_STOPPED && !deadman_drives(deadman))
        return false;
    deadman->mode = mode;
    deadman->sequence = sequence;
    deadman->since = now;
    return true;
}

void deadman_tick(deadman_t *deadman, ticks_t limit, ticks_t now)
{
    if (deadman->owner == NO_OWNER || now - deadman->commanded < limit)
        return;
    deadman->owner = NO_OWNER;
    if (deadman_drives(deadman))
        deadman->mode = MODE_EXPIRED;
}

void deadman_hold(deadman_t *deadman, uint8_t mode)
{
    deadman->mode = mode;
}

void deadman_clear(deadman_t *deadman)
{
    if (is_held(deadman))
        stand(deadman);
}

void deadman_button(deadman_t *deadman, bool pressed)
{
    deadman->pressed = pressed;
    if (pressed && deadman->mode != MODE_UNSET && !is_held(deadman))
        deadman->mode = MODE_BUTTON;
}
