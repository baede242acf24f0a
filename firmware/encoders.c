#include "encoders.h"

#include <avr/io.h>
#include <util/atomic.h>

#include "board.h"
#include "capture.h"
#include "clock.h"

/* Ages are told in 16 bits of 64 us; older edges are marked so before the clock comes round. */
#define OLD_TICKS ((ticks_t)AGE_NONE * 16)

typedef struct {
    register_t *in; /* PINx; null before there are settings */
    register_t *in_b; /* of the second channel; null with one channel */
    uint8_t mask, mask_b, interrupt;
    bool level;     /* last one seen, when both flanks interrupt */
    bool reversed;  /* quadrature counts the other way */
    bool any;       /* there is a last edge, not too old */
    bool moved;
    int8_t direction;
    uint8_t run;    /* edges since the start from rest, up to 2 */
    uint16_t count, rejected;
    ticks_t changed; /* when the level last changed */
    ticks_t last;    /* when the last edge counted */
    ticks_t period;
} sensor_t;

/* Written by interrupts; everybody else reads them with interrupts off. */
static sensor_t sensors[2];
static uint8_t left_interrupt;
static ticks_t glitch; /* ticks; 0: no filter */
static uint8_t edge_kind;
static bool any_flank; /* interrupts on both flanks */
static bool capturing;

static void counted(sensor_t *sensor, bool level, ticks_t now)
{
    if (sensor->in_b) {
        bool other = *sensor->in_b & sensor->mask_b;
        int8_t direction = (level == other) != sensor->reversed ? -1 : 1;
        if (direction != sensor->direction)
            sensor->run = 0;
        sensor->direction = direction;
    }
    sensor->count = (uint16_t)(sensor->count + sensor->direction);
    sensor->period = now - sensor->last;
    sensor->last = now;
    sensor->any = sensor->moved = true;
    if (sensor->run < 2)
        sensor->run++;
}

/* An edge counts when the level that it ends had lasted the glitch time: bounce of either flank
   makes only short levels, so neither adds a count. */
void encoders_edge(uint8_t interrupt)
{
    uint8_t wheel = interrupt != left_interrupt;
    sensor_t *sensor = &sensors[wheel];
    ticks_t now = clock_now();
    bool level = *sensor->in & sensor->mask;
    if (any_flank) {
        if (capturing)
            capture_put(wheel, level, now);
        ticks_t lasted = now - sensor->changed;
        /* The level that the first edge since the last look went to; the pin may have gone there
           and back before this interrupt ran. */
        bool reached = !sensor->level;
        sensor->changed = now;
        sensor->level = level;
        if (edge_kind == (reached ? EDGE_FALLING : EDGE_RISING))
            return;
        level = reached;
        if (lasted < glitch) {
            sensor->rejected++;
            return;
        }
    }
    counted(sensor, level, now);
}

static void sense(void)
{
    any_flank = glitch != 0 || capturing || edge_kind == EDGE_BOTH;
    uint8_t how = any_flank ? SENSE_ANY : edge_kind == EDGE_FALLING ? SENSE_FALLING : SENSE_RISING;
    for (uint8_t wheel = 0; wheel < 2; wheel++) {
        sensors[wheel].level = *sensors[wheel].in & sensors[wheel].mask;
        board_sense(sensors[wheel].interrupt, how);
    }
}

/* `pins` are the first and the second channel, as they stand in the settings. */
static void configure(sensor_t *sensor, const uint8_t *pins, bool reversed)
{
    pin_t pin;
    sensor->reversed = reversed;
    sensor->direction = 1;
    sensor->in_b = 0;
    if (board_input(pins[1], &pin)) {
        sensor->in_b = pin.port;
        sensor->mask_b = pin.mask;
    }
    board_input(pins[0], &pin);
    sensor->in = pin.port;
    sensor->mask = pin.mask;
    sensor->interrupt = pin.interrupt;
}

void encoders_configure(const settings_t *settings)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        EIMSK = 0;
        glitch = settings->glitch / 4;
        edge_kind = settings->edge;
        configure(&sensors[0], &settings->left_encoder, settings->left_encoder_reversed);
        configure(&sensors[1], &settings->right_encoder, settings->right_encoder_reversed);
        left_interrupt = sensors[0].interrupt;
        sense();
    }
}

void encoders_face(uint8_t wheel, int16_t wanted)
{
    if (wanted != 0 && !sensors[wheel].in_b)
        sensors[wheel].direction = wanted < 0 ? -1 : 1;
}

ticks_t encoders_read(encoder_t both[2])
{
    ticks_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        now = clock_now();
        for (uint8_t wheel = 0; wheel < 2; wheel++) {
            sensor_t *sensor = &sensors[wheel];
            ticks_t age = now - sensor->last;
            if (age >= OLD_TICKS) {
                sensor->any = false;
                if (now - sensor->changed >= OLD_TICKS)
                    sensor->changed = now - OLD_TICKS; /* before the clock comes round */
            }
            both[wheel].count = sensor->count;
            both[wheel].rejected = sensor->rejected;
            both[wheel].age = sensor->any ? (uint16_t)(age >> 4) : AGE_NONE;
        }
    }
    return now;
}

speed_edges_t encoders_edges(uint8_t wheel)
{
    speed_edges_t edges;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        ticks_t age = clock_now() - sensors[wheel].last;
        edges.edges = sensors[wheel].run;
        edges.period = sensors[wheel].period;
        if (age > edges.period)
            edges.period = age;
    }
    return edges;
}

void encoders_forget(uint8_t wheel)
{
    sensors[wheel].run = 0;
}

bool encoders_moved(uint8_t wheel)
{
    volatile bool *flag = &sensors[wheel].moved;
    bool moved = *flag;
    *flag = false; /* an edge just between is seen by the next one */
    return moved;
}

void encoders_capture(bool on)
{
    capturing = on;
    if (sensors[0].in)
        ATOMIC_BLOCK(ATOMIC_RESTORESTATE) sense();
}
