#include "encoders.h"

#include <avr/io.h>
#include <util/atomic.h>

#include "capture.h"
#include "clock.h"
#include "status.h"

/* Ages have 16 bits of 64 us; older edges are marked before the clock wraps. */
#define OLD_TICKS ((ticks_t)AGE_NONE * 16)

static ticks_t glitch; /* 0: no filter */
static uint8_t edge_kind;
static bool both_edges; /* interrupts on rising and falling edges */
static bool capturing;

static void counted(encoder_t *encoder, bool level, ticks_t now)
{
    if (encoder->in_b.at) {
        int8_t direction = 1;
        if ((level == board_read(&encoder->in_b)) != encoder->reversed)
            direction = -1;
        if (direction != encoder->direction)
            encoder->run = 0;
        encoder->direction = direction;
    }
    encoder->count = (uint16_t)(encoder->count + encoder->direction);
    encoder->period = now - encoder->last;
    encoder->last = now;
    encoder->any = encoder->moved = true;
    if (encoder->run < 2)
        encoder->run++;
}

/* An edge counts when the level before it lasted the glitch time: bounce makes only short levels, so
   it adds no count. */
void encoders_edge(encoder_t *encoder)
{
    ticks_t now = clock_now();
    bool level = board_read(&encoder->in);
    if (both_edges) {
        if (capturing)
            capture_put(encoder->wheel, level, now);
        ticks_t lasted = now - encoder->changed;
        /* Level after the first edge since the last interrupt; the pin may have changed twice before
           this interrupt ran. */
        bool reached = !encoder->level;
        encoder->changed = now;
        encoder->level = level;
        if (edge_kind == (reached ? EDGE_FALLING : EDGE_RISING))
            return;
        level = reached;
        if (lasted < glitch) {
            status[ITEM_LEFT_REJECTED + encoder->wheel]++;
            return;
        }
    }
    counted(encoder, level, now);
}

static void sense(encoder_t *encoder)
{
    encoder->level = board_read(&encoder->in);
    board_sense(encoder->interrupt, both_edges ? EDGE_BOTH : edge_kind);
}

static void choose_edges(void)
{
    both_edges = glitch != 0 || capturing || edge_kind == EDGE_BOTH;
}

void encoders_configure(const settings_t *settings)
{
    EIMSK = 0;
    glitch = settings->glitch / 4;
    edge_kind = settings->edge;
    choose_edges();
}

void encoders_connect(encoder_t *encoder, const uint8_t *pins)
{
    pin_t pin;
    board_pin(pins[0], &pin);
    encoder->interrupt = pin.interrupt;
    encoder->direction = 1;
    board_input(pins[0], &encoder->in);
    if (!board_input(pins[1], &encoder->in_b))
        encoder->in_b.at = 0;
    sense(encoder);
}

void encoders_set_direction(encoder_t *encoder, int16_t wanted)
{
    if (wanted != 0 && !encoder->in_b.at)
        encoder->direction = wanted < 0 ? -1 : 1;
}

uint16_t encoders_age(encoder_t *encoder, ticks_t now)
{
    ticks_t age = now - encoder->last;
    if (age >= OLD_TICKS)
        encoder->any = false;
    if (now - encoder->changed >= OLD_TICKS)
        encoder->changed = now - OLD_TICKS; /* before the clock wraps */
    return encoder->any ? (uint16_t)(age >> 4) : AGE_NONE;
}

ticks_t encoders_period(const encoder_t *encoder)
{
    ticks_t age, period;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        age = clock_now() - encoder->last;
        period = encoder->period;
    }
    if (encoder->run < 2)
        return TICKS_UNKNOWN;
    return age > period ? age : period;
}

void encoders_capture(encoder_t *left, encoder_t *right, bool on)
{
    capturing = on;
    choose_edges();
    if (left->in.at)
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
        {
            sense(left);
            sense(right);
        }
}
