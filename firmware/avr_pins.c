/* Pins and PWM outputs of AVR boards, by data addresses. Also built for the host. */
#include "avr_pins.h"

#include "atomic.h"

static uint8_t mask(uint8_t bit)
{
    uint8_t mask = 1;
    while (bit--)
        mask = (uint8_t)(mask << 1);
    return mask;
}

/* Data address of PINx: A to G are consecutive, H to L start at 0x100. */
static uint16_t address(uint8_t port)
{
    return (port < H ? 0x20 : 0x100 - 3 * H) + 3 * port;
}

bool board_pin(uint8_t number, pin_t *pin)
{
    if (number >= avr_pin_count)
        return false;
    uint16_t word = pgm_read_word(&avr_pins[number]);
    uint8_t abilities = (uint8_t)(word >> 8);
    pin->bit.at = (register_t *)(uintptr_t)address(word & 0xF);
    pin->bit.mask = (word & 0xF) == NO_PORT ? 0 : mask((uint8_t)word >> 4);
    pin->pwm = abilities & 0xF;
    pin->interrupt = abilities >> 4;
    return true;
}

uint8_t board_group(const bit_t *bit)
{
    uint8_t group = 0;
    while (group < NO_GROUP
           && bit->at != (register_t *)(uintptr_t)address(pgm_read_byte(&avr_groups[group])))
        group++;
    return group;
}

void board_write(const bit_t *bit, uint8_t offset, bool high)
{
    register_t *at = bit->at + offset;
    ATOMIC
    {
        uint8_t value = *at | bit->mask;
        if (!high)
            value ^= bit->mask;
        *at = value;
    }
}

bool board_read(const bit_t *bit)
{
    return *bit->at & bit->mask;
}

bool board_input(uint8_t number, bit_t *bit)
{
    pin_t pin;
    if (!board_pin(number, &pin))
        return false;
    *bit = pin.bit;
    board_write(bit, DIRECTION, false);
    board_write(bit, OUTPUT, true);
    return true;
}

void board_release_input(const bit_t *bit)
{
    board_write(bit, OUTPUT, false);
}

/* The timer drives the pin only between 0 and full duty, which fast PWM cannot produce exactly. */
void board_set_duty(const bit_t *pin, const pwm_t *output, uint8_t duty)
{
    *output->compare = duty; /* the high byte of a 16-bit timer stays 0 */
    board_write(pin, OUTPUT, duty == UINT8_MAX);
    board_write(&output->connect, 0, (uint8_t)(duty + 1) > 1);
}

/* OCRnx stand behind TCCRnA: from 3 on in steps of 1 for 8-bit timers, from 8 on in steps of 2 for
   16-bit ones. */
void board_pwm(uint8_t number, pwm_t *output)
{
    const uint16_t *timer = avr_timers;
    bool wide = number >= avr_first_wide;
    for (; number >= OUTPUTS_PER_TIMER; number -= OUTPUTS_PER_TIMER)
        timer++;
    output->connect.at = (register_t *)(uintptr_t)pgm_read_word(timer);
    output->connect.mask = mask((uint8_t)(7 - 2 * number));
    output->compare = output->connect.at + (wide ? 8 + 2 * number : 3 + number);
}
