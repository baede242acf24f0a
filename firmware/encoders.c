#include "encoders.h"

#include "atomic.h"
#include "capture.h"
#include "status.h"

/* Ages have 16 bits of 64 us; older edges are marked before the clock wraps. */
#define OLD_TICKS ((ticks_t)AGE_NONE * 16)
#define TICK_US 4

/* Successive edges of two channels that follow each other this fast, in one direction, are those of a
   turning wheel: bounce counts up and down in turn. Above 3000 edges/s B may have changed before the
   interrupt reads it, and no wheel turns round from one edge to the next: its direction stays until
   the edges are slower. */
#define FAST_TICKS 83
#define SLOW_TICKS 125
#define FAST_EDGES 8
#define STANDSTILL_TICKS (TICKS_PER_MS * 2) /* then the wheel stands, without an edge to show it */

static ticks_t glitch; /* 0: no filter */
static uint8_t edge_kind;
static bool both_edges; /* interrupts on rising and falling edges */
static bool every_edge; /* of two channels counts */
static bool capturing;

static void counted(encoder_t *encoder, ticks_t now)
{
    encoder->count = (uint16_t)(encoder->count + encoder->direction);
    encoder->edges++;
    encoder->last = now;
    encoder->any = true;
}

/* With two channels an edge of A counts while B is low, up when A rises and down when it falls: both
   directions count at the same places of the disc, and a wheel that rocks over one adds nothing. */
static void edge_of_two(encoder_t *encoder)
{
    ticks_t now = board_now();
    bool short_since = now - encoder->last < FAST_TICKS;
    if (encoder->fast_edges == FAST_EDGES) {
        if (now - encoder->last > SLOW_TICKS) {
            encoder->fast_edges = 0;
            board_sense(encoder->interrupt, EDGE_BOTH);
        }
        counted(encoder, now);
        return;
    }
    bool level = board_read(&encoder->in);
    if (capturing)
        capture_put(encoder->wheel, level, now);
    if (board_read(&encoder->in_b))
        return;
    int8_t direction = level != encoder->reversed ? 1 : -1;
    if (capturing || !short_since || direction != encoder->direction)
        encoder->fast_edges = 0;
    else if (++encoder->fast_edges == FAST_EDGES)
        board_sense(encoder->interrupt, level ? EDGE_RISING : EDGE_FALLING);
    encoder->direction = direction;
    counted(encoder, now);
}

/* Quarter of a slot by the levels of A and B, which go forward 00, 10, 11, 01. */
static uint8_t quarter_of(bool a, bool b)
{
    return (uint8_t)(b << 1 | (a ^ b));
}

/* Every edge of both channels counts. The levels alone tell how far the wheel has come since the last
   interrupt, so bounce adds nothing; when it has passed two edges since, it goes on as before. */
static void edge_of_four(encoder_t *encoder)
{
    bool a = board_read(&encoder->in), b = board_read(&encoder->in_b);
    uint8_t quarter = quarter_of(a, b);
    uint8_t moved = (uint8_t)(quarter - encoder->quarter) & 3;
    if (capturing && a != encoder->level)
        capture_put(encoder->wheel, a, board_now());
    encoder->level = a;
    if (moved == 0)
        return;
    encoder->quarter = quarter;
    uint8_t steps = moved == 2 ? 2 : 1;
    if (moved != 2)
        encoder->direction = (moved == 1) != encoder->reversed ? 1 : -1;
    encoder->count = (uint16_t)(encoder->count + encoder->direction * steps);
    encoder->edges = (uint16_t)(encoder->edges + steps);
    encoder->last = board_now();
    encoder->any = true;
}

/* An edge counts when the level before it lasted the glitch time: bounce makes only short levels, so
   it adds no count. */
void encoders_edge(encoder_t *encoder)
{
    if (!storm_admits(&encoder->storm)) {
        board_mute(encoder->interrupt);
        if (BOARD_EVERY_EDGE)
            board_mute(encoder->interrupt_b);
        return;
    }
    if (BOARD_EVERY_EDGE && encoder->interrupt_b != BOARD_NOTHING) {
        edge_of_four(encoder);
        return;
    }
    if (encoder->in_b.at) {
        edge_of_two(encoder);
        return;
    }
    ticks_t now = board_now();
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
        if (lasted < glitch) {
            status[ITEM_LEFT_REJECTED + encoder->wheel]++;
            return;
        }
    }
    counted(encoder, now);
}

static void sense(encoder_t *encoder)
{
    if (encoder->storm.muted)
        return;
    encoder->level = board_read(&encoder->in);
    encoder->fast_edges = 0;
    board_sense(encoder->interrupt, both_edges || encoder->in_b.at ? EDGE_BOTH : edge_kind);
    if (BOARD_EVERY_EDGE)
        board_sense(encoder->interrupt_b, EDGE_BOTH);
}

static void choose_edges(void)
{
    both_edges = glitch != 0 || capturing || edge_kind == EDGE_BOTH;
}

void encoders_configure(const settings_t *settings)
{
    board_mute_all();
    glitch = settings->glitch < GLITCH_MINIMUM ? 0 : settings->glitch / TICK_US;
    edge_kind = settings->edge;
    every_edge = settings->every_edge;
    choose_edges();
}

void encoders_connect(encoder_t *encoder, const uint8_t *pins, uint32_t edges_per_s)
{
    pin_t pin;
    storm_begin(&encoder->storm, edges_per_s);
    if (BOARD_EVERY_EDGE)
        encoder->interrupt_b = BOARD_NOTHING;
    encoder->storm.checked_edges = encoder->edges;
    encoder->direction = 1;
    if (!board_pin(pins[0], &pin)) {
        encoder->in.at = encoder->in_b.at = 0; /* no encoder */
        encoder->interrupt = BOARD_NOTHING;
        return;
    }
    encoder->interrupt = pin.interrupt;
    board_input(pins[0], &encoder->in);
    if (!board_input(pins[1], &encoder->in_b))
        encoder->in_b.at = 0;
    if (BOARD_EVERY_EDGE && every_edge && board_pin(pins[1], &pin)) {
        encoder->interrupt_b = pin.interrupt;
        encoder->quarter = quarter_of(board_read(&encoder->in), board_read(&encoder->in_b));
    }
    sense(encoder);
}

void encoders_tick(encoder_t *encoder)
{
    ATOMIC
    {
        bool stands = encoder->fast_edges == FAST_EDGES && board_now() - encoder->last > STANDSTILL_TICKS;
        if (storm_tick(&encoder->storm) || stands)
            sense(encoder);
    }
}

void encoders_check(encoder_t *encoder)
{
    uint16_t changes, edges;
    ATOMIC
    {
        changes = encoder->storm.changes;
        edges = encoder->edges;
    }
    storm_check(&encoder->storm, changes, edges);
}

void encoders_set_direction(encoder_t *encoder, int16_t command)
{
    if (command != 0 && !encoder->in_b.at)
        encoder->direction = command < 0 ? -1 : 1;
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

uint16_t encoders_take(encoder_t *encoder, ticks_t *last)
{
    uint16_t edges;
    ATOMIC
    {
        edges = encoder->edges;
        *last = encoder->last;
    }
    uint16_t count = (uint16_t)(edges - encoder->taken);
    encoder->taken = edges;
    return count;
}

void encoders_capture(encoder_t *left, encoder_t *right, bool on)
{
    capturing = on;
    choose_edges();
    if (left->in.at)
        ATOMIC
        {
            sense(left);
            sense(right);
        }
}
