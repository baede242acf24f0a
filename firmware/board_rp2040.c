/* Raspberry Pi Pico: pins and PWM outputs. GP23, 24 and 29 serve its supply; GP0 and GP1 are the link. */
#include "atomic.h"
#include "board.h"
#include "protocol.h"
#include "rp2040_registers.h"

const uint8_t board_code = BOARD_RP2040;
const uint8_t board_analogs = 3;
const uint8_t board_first_analog = 26;
const uint8_t board_sda = 4;
const uint8_t board_scl = 5;

#define LAST_PIN 28
#define LAST_DIGITAL 22 /* after it the LED and the analog inputs */
#define PINS_OF_SUPPLY (1u << 23 | 1u << 24)
#define PINS_OF_LINK 3u
#define PWM_OUTPUTS 16 /* eight slices of two: pin 16 has the output of pin 0, and so on */
#define PWM_SLICES 8
#define PWM_DIVISION 192 /* 48 MHz / 192 / 255: 980 Hz, as on the other boards */
#define PAD_OF_INPUT (PAD_INPUT | PAD_SCHMITT | PAD_4_MA)

bool board_pin(uint8_t number, pin_t *pin)
{
    if (number > LAST_PIN || PINS_OF_SUPPLY >> number & 1)
        return false;
    bool link = PINS_OF_LINK >> number & 1, plain = link || number > LAST_DIGITAL;
    pin->bit = (bit_t){&REGISTER(SIO_LEVELS), 1u << number};
    pin->pwm = plain ? BOARD_NOTHING : number % PWM_OUTPUTS;
    pin->interrupt = link ? BOARD_LINK : plain ? BOARD_NOTHING : number;
    return true;
}

static uint8_t number_of(const bit_t *bit)
{
    uint8_t number = 0;
    while (!(bit->mask >> number & 1))
        number++;
    return number;
}

/* A change of direction also takes the pin from the PWM unit. */
void board_write(const bit_t *bit, uint8_t offset, bool high)
{
    uint32_t set = offset == DIRECTION ? SIO_DIRECTION : SIO_OUTPUT;
    REGISTER(set + (high ? SIO_SET : SIO_CLEAR)) = bit->mask;
    if (offset == DIRECTION) {
        REGISTER(PAD(number_of(bit))) = PAD_OF_INPUT;
        REGISTER(IO_CTRL(number_of(bit))) = FUNCTION_SIO;
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
    REGISTER(PAD(number)) = PAD_OF_INPUT | PAD_PULL_UP;
    return true;
}

void board_release_input(const bit_t *bit)
{
    REGISTER(PAD(number_of(bit))) = PAD_OF_INPUT;
}

void board_pwm(uint8_t number, pwm_t *output)
{
    output->compare = (volatile uint16_t *)(PWM_SLICE(number / 2) + PWM_COMPARE) + number % 2;
}

/* The unit writes both halves of a register when one is written, so both are written here. */
static void set_compare(const pwm_t *output, uint8_t duty)
{
    uintptr_t at = (uintptr_t)output->compare & ~(uintptr_t)3;
    uint32_t shift = 8 * ((uintptr_t)output->compare & 2);
    ATOMIC
        REGISTER(at) = (REGISTER(at) & ~(0xFFFFu << shift)) | (uint32_t)duty << shift;
}

/* A constant level does not wait for the end of a period. */
void board_set_duty(const bit_t *pin, const pwm_t *output, uint8_t duty)
{
    bool constant = duty == 0 || duty == UINT8_MAX;
    set_compare(output, duty);
    if (constant)
        board_write(pin, OUTPUT, duty != 0);
    REGISTER(IO_CTRL(number_of(pin))) = constant ? FUNCTION_SIO : FUNCTION_PWM;
}

void board_start_timers(void)
{
    for (uint8_t slice = 0; slice < PWM_SLICES; slice++) {
        REGISTER(PWM_SLICE(slice) + PWM_DIVISOR) = PWM_DIVISION << 4;
        REGISTER(PWM_SLICE(slice) + PWM_TOP) = UINT8_MAX - 1; /* 255 steps */
        REGISTER(PWM_SLICE(slice) + PWM_CONTROL) = 1;
    }
}
