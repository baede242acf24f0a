#include "settings.h"

#include <stdbool.h>
#include <stddef.h>

#include "board.h"

enum { PLAIN_PIN, PWM_PIN, INTERRUPT_PIN, OPTIONAL = 0x10 };

/* What the pins of the settings frame are for, in its order from left_enable on. */
#define PINS 11
static const uint8_t roles[PINS] PROGMEM = {
    PWM_PIN, PLAIN_PIN, PLAIN_PIN, INTERRUPT_PIN, PLAIN_PIN | OPTIONAL,
    PWM_PIN, PLAIN_PIN, PLAIN_PIN, INTERRUPT_PIN, PLAIN_PIN | OPTIONAL, PLAIN_PIN | OPTIONAL,
};

/* Lowest and highest of the numbers of the settings frame, in its order from telemetry on. */
#define NUMBERS 7
static const uint16_t limits[NUMBERS][2] PROGMEM = {
    {1, TELEMETRY_MAXIMUM}, {1, SLOTS_MAXIMUM}, {0, GLITCH_MAXIMUM},
    {DEADMAN_MINIMUM, DEADMAN_MAXIMUM}, {0, INT16_MAX}, {0, UINT16_MAX}, {0, INT16_MAX},
};

static uint8_t suits(uint8_t number, uint8_t role)
{
    pin_t pin;
    if (!board_pin(number, &pin))
        return REFUSAL_PIN_MISSING;
    if (pin.ability == ABLE_LINK)
        return REFUSAL_PIN_LINK;
    if (role == PWM_PIN && pin.pwm == BOARD_NONE)
        return REFUSAL_PIN_PWM;
    if (role == INTERRUPT_PIN && pin.interrupt == BOARD_NONE)
        return REFUSAL_PIN_INTERRUPT;
    return REFUSAL_NONE;
}

static uint8_t check_pins(const uint8_t *pins, uint8_t *index)
{
    for (uint8_t i = 0; i < PINS; i++) {
        uint8_t role = pgm_read_byte(&roles[i]);
        *index = i;
        if (pins[i] == PIN_NONE && role & OPTIONAL)
            continue;
        uint8_t refusal = suits(pins[i], role & (uint8_t)~OPTIONAL);
        if (refusal != REFUSAL_NONE)
            return refusal;
        for (uint8_t j = 0; j < i; j++)
            if (pins[j] == pins[i])
                return REFUSAL_PIN_TWICE;
        for (uint8_t j = PINS; j < PINS + 2; j++) /* range and battery are analog channels */
            if (pins[j] != PIN_NONE && board_first_analog + pins[j] == pins[i])
                return REFUSAL_PIN_TWICE;
    }
    for (uint8_t j = PINS; j < PINS + 2; j++) {
        *index = j;
        if (pins[j] != PIN_NONE && pins[j] >= board_analogs)
            return REFUSAL_PIN_ANALOG;
    }
    return pins[PINS] == pins[PINS + 1] && pins[PINS] != PIN_NONE ? REFUSAL_PIN_TWICE
                                                                  : REFUSAL_NONE;
}

static bool numbers_fit(const settings_t *settings, uint8_t *index)
{
    const uint8_t *at = (const uint8_t *)settings + offsetof(settings_t, telemetry);
    for (uint8_t i = 0; i < NUMBERS; i++, at += 2) {
        uint16_t number = (uint16_t)(at[0] | at[1] << 8);
        *index = i;
        if (number < pgm_read_word(&limits[i][0]) || number > pgm_read_word(&limits[i][1]))
            return false;
    }
    return true;
}

uint8_t settings_check(const settings_t *settings, uint8_t *field)
{
    uint8_t index;
    const uint8_t *pins = (const uint8_t *)settings + offsetof(settings_t, left_enable);
    uint8_t refusal = check_pins(pins, &index);
    *field = (uint8_t)(FIELD_LEFT_ENABLE + index);
    if (refusal != REFUSAL_NONE)
        return refusal;
    bool fits = numbers_fit(settings, &index);
    *field = (uint8_t)(FIELD_TELEMETRY + index);
    if (!fits)
        return REFUSAL_RANGE;
    *field = FIELD_EDGE;
    if (settings->edge > EDGE_BOTH)
        return REFUSAL_RANGE;
    *field = FIELD_RESERVED;
    if (settings->reserved != 0)
        return REFUSAL_RANGE;
    *field = FIELD_BAUD;
    return settings->baud > BAUD_B115200 ? REFUSAL_RANGE : REFUSAL_NONE;
}
