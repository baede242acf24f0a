#include "encoders.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board.h"
#include "capture.h"
#include "clock.h"

/* Ages are told in 16 bits of 64 us; older edges are marked so before the clock comes round. */
#define OLD_TICKS ((uint32_t)AGE_NONE * 16)

typedef struct {
    volatile uint8_t *in; /* PINx */
    uint8_t mask;
    volatile uint8_t *in_b; /* second channel; null with one channel */
    uint8_t mask_b;
    bool level;        /* last one seen, when both flanks interrupt */
    bool counts_high;  /* a rising edge counts */
    bool counts_low;   /* a falling edge counts */
    bool reversed;     /* quadrature counts the other way */
    bool any;          /* there is a last edge, not too old */
    bool moved;
    int8_t direction;
    uint8_t run;       /* edges since the start from rest, up to 2 */
    uint8_t interrupt;
    uint16_t count;
    uint16_t rejected;
    uint32_t changed;  /* when the level last changed */
    uint32_t last;     /* when the last edge counted */
    uint32_t period;
} sensor_t;

static volatile sensor_t states[2];
static uint8_t wheel_of[8];
static uint32_t glitch;     /* ticks; 0: no filter */
static bool any_flank;      /* interrupts on both flanks */
static volatile bool capturing;
static uint8_t edge_kind;

static inline void counted(volatile sensor_t *state, bool level, uint32_t now)
{
    int8_t direction = state->direction;
    if (state->in_b) {
        bool other = (*state->in_b & state->mask_b) != 0;
        direction = (level == other) != state->reversed ? -1 : 1;
        if (direction != state->direction)
            state->run = 0;
        state->direction = direction;
    }
    state->count = (uint16_t)(state->count + direction);
    state->period = now - state->last;
    state->last = now;
    state->any = state->moved = true;
    if (state->run < 2)
        state->run++;
}

/* An edge counts when the level that it ends had lasted the glitch time: bounce of either flank
   makes only short levels, so neither adds a count. */
static inline void edge(uint8_t wheel)
{
    volatile sensor_t *state = &states[wheel];
    uint32_t now = clock_now();
    bool level = (*state->in & state->mask) != 0;
    if (!any_flank) {
        counted(state, level, now);
        return;
    }
    if (capturing)
        capture_put(wheel, level, now);
    uint32_t lasted = now - state->changed;
    state->changed = now;
    if (level == state->level) {
        state->rejected++; /* there and back again before this interrupt ran */
        return;
    }
    state->level = level;
    if (!(level ? state->counts_high : state->counts_low))
        return;
    if (lasted < glitch)
        state->rejected++;
    else
        counted(state, level, now);
}

ISR(INT0_vect) { edge(wheel_of[0]); }
ISR(INT1_vect) { edge(wheel_of[1]); }
ISR(INT2_vect) { edge(wheel_of[2]); }
ISR(INT3_vect) { edge(wheel_of[3]); }
ISR(INT4_vect) { edge(wheel_of[4]); }
ISR(INT5_vect) { edge(wheel_of[5]); }

static void sense(void)
{
    any_flank = glitch != 0 || capturing || edge_kind == EDGE_BOTH;
    uint8_t how = any_flank ? SENSE_ANY : edge_kind == EDGE_FALLING ? SENSE_FALLING : SENSE_RISING;
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        states[wheel].level = (*states[wheel].in & states[wheel].mask) != 0;
        board_sense(states[wheel].interrupt, how);
    }
}

static volatile uint8_t *input(uint8_t number, volatile uint8_t *mask)
{
    pin_t pin;
    board_pin(number, &pin);
    volatile uint8_t *in = (volatile uint8_t *)pin.port;
    in[1] &= (uint8_t)~pin.mask;
    in[2] |= pin.mask; /* pull-up: open collector outputs need it */
    *mask = pin.mask;
    wheel_of[pin.interrupt & 7] = 0;
    return in;
}

static void configure(uint8_t wheel, uint8_t number, uint8_t number_b, bool reversed)
{
    volatile sensor_t *state = &states[wheel];
    pin_t pin;
    uint16_t count = state->count;
    *state = (sensor_t){.direction = 1, .count = count, .reversed = reversed};
    state->in = input(number, &state->mask);
    if (number_b != PIN_NONE)
        state->in_b = input(number_b, &state->mask_b);
    board_pin(number, &pin);
    state->interrupt = pin.interrupt;
    state->counts_high = edge_kind != EDGE_FALLING;
    state->counts_low = edge_kind != EDGE_RISING;
    wheel_of[pin.interrupt] = wheel;
}

void encoders_configure(const settings_t *settings)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        board_interrupts_off();
        glitch = settings->glitch / 4;
        edge_kind = settings->edge;
        configure(0, settings->left_encoder, settings->left_encoder_b,
                  settings->encoder_reversed_left);
        configure(1, settings->right_encoder, settings->right_encoder_b,
                  settings->encoder_reversed_right);
        sense();
    }
}

void encoders_direct(uint8_t wheel, int8_t direction)
{
    if (!states[wheel].in_b)
        states[wheel].direction = direction;
}

void encoders_read(encoder_t both[2], uint32_t *now)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        *now = clock_now();
        for (uint8_t wheel = 0; wheel < 2; wheel++) {
            volatile sensor_t *state = &states[wheel];
            both[wheel].count = state->count;
            both[wheel].rejected = state->rejected;
            both[wheel].age = *now - state->last;
            if (both[wheel].age >= OLD_TICKS)
                state->any = false;
            both[wheel].any = state->any;
        }
    }
}

speed_edges_t encoders_edges(uint8_t wheel)
{
    speed_edges_t edges;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        edges.edges = states[wheel].run;
        edges.period = states[wheel].period;
        edges.age = clock_now() - states[wheel].last;
    }
    return edges;
}

void encoders_forget(uint8_t wheel)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) states[wheel].run = 0;
}

bool encoders_moved(uint8_t wheel)
{
    bool moved;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        moved = states[wheel].moved;
        states[wheel].moved = false;
    }
    return moved;
}

void encoders_capture(bool on)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        capturing = on;
        if (states[0].in)
            sense();
    }
}
