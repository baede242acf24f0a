#include "ranges.h"

#include "analog.h"
#include "board.h"
#include "settings.h"

/* One sensor has the turn for this time, so that no two echoes overlap: sound travels 17 m in it, and a sensor
   measures up to 4 m. */
#define TURN_MS 50
/* An HC-SR04 begins its echo 0.5 ms after the trigger, and ends it after 38 ms if nothing reflects. An
   echo that goes on has no meaning: it may never end. */
#define BEGIN_MS 5
#define LISTEN_TICKS (30 * TICKS_PER_MS)
#define ENDLESS_MS 250
#define TRIGGER_TICKS 4 /* at least 12 us; 10 are needed */
#define AGE_MS 4
#define AGE_MOST 15

enum { DONE, FIRED, RISEN, FALLEN };

static struct {
    bit_t trigger, echo; /* no trigger: an analog sensor */
    uint8_t late_ms;     /* for which the last echo has lasted too long */
} sensors[RANGE_SENSORS];
static uint8_t count, current, elapsed_ms;
static volatile uint8_t state;
static volatile uint16_t risen, fallen; /* ticks, low bits */

void ranges_configure(const settings_t *settings)
{
    board_watch(0);
    state = DONE;
    elapsed_ms = 0;
    for (count = 0; count < RANGE_SENSORS; count++) {
        uint8_t trigger = settings_range_pins(settings, count)[0], input = settings_range_pins(settings, count)[1];
        if (input == 0)
            break;
        sensors[count].trigger.mask = 0;
        sensors[count].late_ms = 0;
        if (trigger == 0)
            continue;
        pin_t pin;
        board_pin(trigger - 1, &pin);
        sensors[count].trigger = pin.bit;
        board_write(&pin.bit, OUTPUT, false);
        board_write(&pin.bit, DIRECTION, true);
        board_input(input - 1, &sensors[count].echo);
        board_release_input(&sensors[count].echo); /* pulled up, an open wire would be an echo */
    }
    current = 0;
}

void ranges_changed(void)
{
    bool level = board_read(&sensors[current].echo);
    if (level && state == FIRED) {
        risen = board_now_low();
        state = RISEN;
    } else if (!level && state == RISEN) {
        fallen = board_now_low();
        state = FALLEN;
    }
}

static void fire(const bit_t *trigger)
{
    state = FIRED;
    board_watch(&sensors[current].echo);
    board_write(trigger, OUTPUT, true);
    uint16_t begun = (uint16_t)board_now();
    while ((uint16_t)((uint16_t)board_now() - begun) < TRIGGER_TICKS)
        ;
    board_write(trigger, OUTPUT, false);
}

/* Begins the turn of a sensor; returns what there is to send, or 0. */
static uint16_t begin(void)
{
    if (sensors[current].trigger.mask == 0) {
        uint16_t reading = analog_mean(ANALOG_SENSORS + current);
        return reading == ANALOG_NONE ? 0 : reading + 1;
    }
    if (!board_read(&sensors[current].echo)) {
        sensors[current].late_ms = 0;
        fire(&sensors[current].trigger);
        return 0;
    }
    if (sensors[current].late_ms < ENDLESS_MS)
        sensors[current].late_ms += TURN_MS;
    return sensors[current].late_ms < ENDLESS_MS ? 0 : RANGE_ENDLESS;
}

/* The result of an echo, or 0 while there is none. */
static uint16_t echo(void)
{
    uint16_t value = 0;
    if (state == FALLEN) {
        value = (uint16_t)(fallen - risen);
        if (value > LISTEN_TICKS)
            value = RANGE_NOTHING;
    } else if (state == FIRED && elapsed_ms >= BEGIN_MS) {
        value = RANGE_SILENT;
    }
    if (value != 0) {
        state = DONE;
        board_watch(0);
    }
    return value;
}

bool ranges_tick(range_t *frame)
{
    uint16_t value;
    if (count == 0)
        return false;
    if (elapsed_ms++ == TURN_MS) {
        elapsed_ms = 0;
        current = current + 1 < count ? current + 1 : 0;
        value = begin();
    } else {
        value = echo();
    }
    if (value == 0)
        return false;
    uint16_t age = (uint16_t)(elapsed_ms + sensors[current].late_ms) / AGE_MS;
    *frame = (range_t){.type = TYPE_RANGE, .sensor = current, .value = value & RANGE_MASK};
    frame->age = age < AGE_MOST ? age : AGE_MOST;
    return true;
}
