#include "settings.h"

#include <stdbool.h>
#include <stddef.h>

#include "board.h"

enum { PLAIN_PIN, PWM_PIN, INTERRUPT_PIN, ANALOG_CHANNEL, NO_PIN, MOTOR_PIN, ECHO_PIN, OPTIONAL = 0x10 };

/* Roles of the pins of the settings frame, in its order from left_enable on. */
#define PINS 13
static const uint8_t roles[PINS] PROGMEM = {
    MOTOR_PIN, MOTOR_PIN, MOTOR_PIN, INTERRUPT_PIN | OPTIONAL, PLAIN_PIN | OPTIONAL,
    MOTOR_PIN, MOTOR_PIN, MOTOR_PIN, INTERRUPT_PIN | OPTIONAL, PLAIN_PIN | OPTIONAL,
    PLAIN_PIN | OPTIONAL,
    ANALOG_CHANNEL | OPTIONAL, ANALOG_CHANNEL | OPTIONAL,
};

/* Roles of enable, in1 and in2 of a wheel, by DRIVER_... */
#define PINS_OF_WHEEL 5
static const uint8_t motor_roles[][3] PROGMEM = {
    [DRIVER_ENABLE_IN1_IN2] = {PWM_PIN, PLAIN_PIN, PLAIN_PIN},
    [DRIVER_ENABLE_DIRECTION] = {PWM_PIN, PLAIN_PIN, NO_PIN},
    [DRIVER_TWO_PWM] = {NO_PIN, PWM_PIN, PWM_PIN},
    [DRIVER_PULSED_INPUTS] = {PLAIN_PIN | OPTIONAL, PWM_PIN, PWM_PIN},
};

/* Minimum and maximum of the numbers of the settings frame, in its order from telemetry on; the last
   row is that of every gain. */
#define NUMBERS 14
#define GAINS 6
static const uint16_t limits[GAINS + 1][2] PROGMEM = {
    {1, TELEMETRY_MAXIMUM}, {1, SLOTS_MAXIMUM}, {1, SLOTS_MAXIMUM}, {0, GLITCH_MAXIMUM},
    {DEADMAN_MINIMUM, DEADMAN_MAXIMUM}, {0, ANALOG_ONE}, {0, GAIN_MAXIMUM},
};

#define GYRO_AXES (2 * GYRO_LSM6)

static uint8_t suits(uint8_t number, uint8_t role)
{
    pin_t pin;
    if (!board_pin(number, &pin))
        return REFUSAL_PIN_MISSING;
    if (pin.interrupt == BOARD_LINK)
        return REFUSAL_PIN_LINK;
    if (role != ANALOG_CHANNEL && pin.bit.mask == 0)
        return REFUSAL_PIN_MISSING; /* an analog input only */
    if (role == PWM_PIN && pin.pwm == BOARD_NOTHING)
        return REFUSAL_PIN_PWM;
    if (role == INTERRUPT_PIN && pin.interrupt == BOARD_NOTHING)
        return REFUSAL_PIN_INTERRUPT;
    if (role == ECHO_PIN && board_group(&pin.bit) == NO_GROUP)
        return REFUSAL_PIN_INTERRUPT;
    return REFUSAL_NONE;
}

/* Pins that are in use, with analog channels as pin numbers. */
#define USES (PINS + 1 + 2 * RANGE_SENSORS + 2)
typedef struct {
    uint8_t pins[USES];
    uint8_t count;
    uint16_t outputs; /* PWM outputs, where pins share them */
} uses_t;

/* Adds a use of a pin, or of an analog channel. */
static uint8_t use(uses_t *uses, uint8_t pin, uint8_t role)
{
    if (role == ANALOG_CHANNEL) {
        if (pin >= board_analogs)
            return REFUSAL_PIN_ANALOG;
        pin = (uint8_t)(pin + board_first_analog);
    }
    uint8_t refusal = suits(pin, role);
    if (refusal != REFUSAL_NONE)
        return refusal;
    for (uint8_t i = 0; i < uses->count; i++)
        if (uses->pins[i] == pin)
            return REFUSAL_PIN_TWICE;
    if (BOARD_SHARES_PWM && role == PWM_PIN) {
        pin_t found;
        board_pin(pin, &found);
        uint16_t output = (uint16_t)(1u << found.pwm);
        if (uses->outputs & output)
            return REFUSAL_PIN_TWICE;
        uses->outputs |= output;
    }
    uses->pins[uses->count++] = pin;
    return REFUSAL_NONE;
}

/* *field is the refused one. */
static uint8_t check_pins(const uint8_t *numbers, uint8_t driver, uses_t *uses, uint8_t *field)
{
    for (uint8_t i = 0; i < PINS; i++) {
        uint8_t role = pgm_read_byte(&roles[i]), pin = numbers[i];
        *field = (uint8_t)(FIELD_LEFT_ENABLE + i);
        if (role == MOTOR_PIN)
            role = pgm_read_byte(&motor_roles[driver][i % PINS_OF_WHEEL]);
        if (pin == PIN_NONE && role & OPTIONAL)
            continue;
        if (role == NO_PIN) {
            if (pin != PIN_NONE)
                return REFUSAL_RANGE;
            continue;
        }
        uint8_t refusal = use(uses, pin, role & (uint8_t)~OPTIONAL);
        if (refusal != REFUSAL_NONE)
            return refusal;
    }
    return REFUSAL_NONE;
}

/* Pins of the fields that were appended; counted from 1. */
static uint8_t check_more_pins(const settings_t *settings, uses_t *uses, uint8_t *field)
{
    *field = FIELD_STANDBY;
    uint8_t refusal = REFUSAL_NONE;
    if (settings->standby != 0)
        refusal = use(uses, settings->standby - 1, PLAIN_PIN);
    for (uint8_t i = 0; i < RANGE_SENSORS && refusal == REFUSAL_NONE; i++) {
        uint8_t trigger = settings_range_pins(settings, i)[0], input = settings_range_pins(settings, i)[1];
        *field = (uint8_t)(FIELD_TRIGGER_1 + 2 * i);
        if (trigger != 0)
            refusal = use(uses, trigger - 1, PLAIN_PIN);
        if (refusal != REFUSAL_NONE)
            break;
        (*field)++;
        if (input != 0)
            refusal = use(uses, input - 1, trigger ? ECHO_PIN : ANALOG_CHANNEL);
        else if (trigger != 0)
            refusal = REFUSAL_RANGE;
    }
    if (settings->gyro_address != 0 && refusal == REFUSAL_NONE) {
        *field = FIELD_GYRO_ADDRESS;
        refusal = use(uses, board_sda, PLAIN_PIN);
        if (refusal == REFUSAL_NONE)
            refusal = use(uses, board_scl, PLAIN_PIN);
        if (settings->gyro_axis >= GYRO_AXES || settings->gyro_upward > UPWARD_DOWN)
            refusal = REFUSAL_RANGE;
    }
    return refusal;
}

/* Then channel B needs an interrupt too. */
static uint8_t check_every_edge(const settings_t *settings, uint8_t *field)
{
    *field = FIELD_LEFT_ENCODER_B;
    uint8_t refusal = suits(settings->left_encoder_b, INTERRUPT_PIN);
    if (refusal != REFUSAL_NONE)
        return refusal;
    *field = FIELD_RIGHT_ENCODER_B;
    return suits(settings->right_encoder_b, INTERRUPT_PIN);
}

static bool numbers_fit(const settings_t *settings, uint8_t *index)
{
    const uint8_t *at = (const uint8_t *)settings + offsetof(settings_t, telemetry);
    const uint16_t *limit = limits[0];
    for (uint8_t i = 0; i < NUMBERS; i++, at += 2) {
        uint16_t number = (uint16_t)(at[0] | at[1] << 8);
        *index = i;
        if (number < pgm_read_word(limit) || number > pgm_read_word(limit + 1))
            return false;
        if (i < GAINS)
            limit += 2;
    }
    return true;
}

bool settings_known(const settings_t *settings, uint8_t size, uint8_t *field)
{
    const uint8_t *byte = (const uint8_t *)settings;
    for (uint8_t i = sizeof *settings; i < size; i++)
        if (byte[i] != 0) {
            *field = UINT8_MAX;
            return false;
        }
    return true;
}

uint8_t settings_check(const settings_t *settings, uint8_t *field)
{
    uint8_t index;
    const uint8_t *pins = (const uint8_t *)settings + offsetof(settings_t, left_enable);
    *field = FIELD_DRIVER;
    if (settings->driver > DRIVER_PULSED_INPUTS)
        return REFUSAL_UNKNOWN;
    uses_t uses = {.count = 0};
    uint8_t refusal = check_pins(pins, settings->driver, &uses, field);
    if (refusal == REFUSAL_NONE)
        refusal = check_more_pins(settings, &uses, field);
    if (refusal != REFUSAL_NONE)
        return refusal;
    if (BOARD_EVERY_EDGE && settings->every_edge) {
        refusal = check_every_edge(settings, field);
        if (refusal != REFUSAL_NONE)
            return refusal;
    }
    bool fits = numbers_fit(settings, &index);
    *field = (uint8_t)(FIELD_TELEMETRY + index);
    if (!fits)
        return REFUSAL_RANGE;
    *field = FIELD_EDGE;
    if (settings->edge == 0)
        return REFUSAL_RANGE;
    *field = FIELD_RESERVED;
    if (settings->reserved != 0 || (!BOARD_EVERY_EDGE && settings->every_edge))
        return REFUSAL_RANGE;
    *field = FIELD_BAUD;
    return settings->baud > BAUD_B115200 ? REFUSAL_RANGE : REFUSAL_NONE;
}
