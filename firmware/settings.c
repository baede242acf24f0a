#include "settings.h"

#include <stdbool.h>

#include "board.h"

/* Pin of analog channel 0. */
#define FIRST_ANALOG_PIN 54
/* Half a million counts a metre would be ten times what any hobby encoder gives. */
#define SLOTS_MAXIMUM 10000

enum { PLAIN_PIN, PWM_PIN, INTERRUPT_PIN };

static uint8_t suits(uint8_t number, uint8_t role)
{
    pin_t pin;
    if (!board_pin(number, &pin))
        return REFUSAL_PIN_MISSING;
    if (pin.link)
        return REFUSAL_PIN_LINK;
    if (role == PWM_PIN && pin.pwm == BOARD_NONE)
        return REFUSAL_PIN_PWM;
    if (role == INTERRUPT_PIN && pin.interrupt == BOARD_NONE)
        return REFUSAL_PIN_INTERRUPT;
    return REFUSAL_NONE;
}

/* A pin of each role, optional or not, in the order of the settings frame. */
static uint8_t check_pins(const settings_t *settings, uint8_t *field)
{
    const struct {
        uint8_t number, role, field;
        bool optional;
    } pins[] = {
        {settings->left_enable, PWM_PIN, FIELD_LEFT_ENABLE, false},
        {settings->left_in1, PLAIN_PIN, FIELD_LEFT_IN1, false},
        {settings->left_in2, PLAIN_PIN, FIELD_LEFT_IN2, false},
        {settings->left_encoder, INTERRUPT_PIN, FIELD_LEFT_ENCODER, false},
        {settings->left_encoder_b, PLAIN_PIN, FIELD_LEFT_ENCODER_B, true},
        {settings->right_enable, PWM_PIN, FIELD_RIGHT_ENABLE, false},
        {settings->right_in1, PLAIN_PIN, FIELD_RIGHT_IN1, false},
        {settings->right_in2, PLAIN_PIN, FIELD_RIGHT_IN2, false},
        {settings->right_encoder, INTERRUPT_PIN, FIELD_RIGHT_ENCODER, false},
        {settings->right_encoder_b, PLAIN_PIN, FIELD_RIGHT_ENCODER_B, true},
        {settings->button, PLAIN_PIN, FIELD_BUTTON, true},
    };
    const uint8_t many = sizeof pins / sizeof *pins;
    for (uint8_t i = 0; i < many; i++) {
        *field = pins[i].field;
        if (pins[i].optional && pins[i].number == PIN_NONE)
            continue;
        uint8_t refusal = suits(pins[i].number, pins[i].role);
        if (refusal != REFUSAL_NONE)
            return refusal;
        for (uint8_t j = 0; j < i; j++)
            if (pins[j].number == pins[i].number)
                return REFUSAL_PIN_TWICE;
        bool range = settings->range != PIN_NONE
            && pins[i].number == FIRST_ANALOG_PIN + settings->range;
        bool battery = settings->battery != PIN_NONE
            && pins[i].number == FIRST_ANALOG_PIN + settings->battery;
        if (range || battery)
            return REFUSAL_PIN_TWICE;
    }
    return REFUSAL_NONE;
}

static uint8_t check_analog(const settings_t *settings, uint8_t *field)
{
    *field = FIELD_RANGE;
    if (settings->range != PIN_NONE && settings->range >= board_analogs)
        return REFUSAL_PIN_ANALOG;
    *field = FIELD_BATTERY;
    if (settings->battery == PIN_NONE)
        return REFUSAL_NONE;
    if (settings->battery >= board_analogs)
        return REFUSAL_PIN_ANALOG;
    return settings->battery == settings->range ? REFUSAL_PIN_TWICE : REFUSAL_NONE;
}

static uint8_t check_values(const settings_t *settings, uint8_t *field)
{
    const struct {
        uint16_t value, low, high;
        uint8_t field;
    } values[] = {
        {settings->edge, EDGE_RISING, EDGE_BOTH, FIELD_EDGE},
        {settings->baud, BAUD_B9600, BAUD_B115200, FIELD_BAUD},
        {settings->reserved, 0, 0, FIELD_RESERVED},
        {settings->slots, 1, SLOTS_MAXIMUM, FIELD_SLOTS},
        {settings->glitch, 0, GLITCH_MAXIMUM, FIELD_GLITCH},
        {settings->deadman, DEADMAN_MINIMUM, DEADMAN_MAXIMUM, FIELD_DEADMAN},
        {settings->telemetry, 1, TELEMETRY_MAXIMUM, FIELD_TELEMETRY},
        {settings->left_start, 0, INT16_MAX, FIELD_LEFT_START},
        {settings->right_start, 0, INT16_MAX, FIELD_RIGHT_START},
    };
    for (uint8_t i = 0; i < sizeof values / sizeof *values; i++) {
        *field = values[i].field;
        if (values[i].value < values[i].low || values[i].value > values[i].high)
            return REFUSAL_RANGE;
    }
    *field = 0;
    return REFUSAL_NONE;
}

uint8_t settings_check(const settings_t *settings, uint8_t *field)
{
    uint8_t refusal = check_pins(settings, field);
    if (refusal == REFUSAL_NONE)
        refusal = check_analog(settings, field);
    if (refusal == REFUSAL_NONE)
        refusal = check_values(settings, field);
    return refusal;
}
