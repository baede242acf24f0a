/* The hardware layer for an ESP32: pins, PWM, edges, clock, serial link, reset. Never run on a chip. */
#define _Static_assert static_assert
extern "C" {
#include "analog.h"
#include "board.h"
#include "clock.h"
#include "link.h"
#include "protocol.h"
#include "ranges.h"
#include "reset.h"
#include "wheel.h"
}
/* The core has macros of some of these names. */
static const uint8_t offset_of_direction = DIRECTION;

#include <Arduino.h>
#include <esp_system.h>
#include <esp_timer.h>

#include "esp32.h"

extern "C" {

const uint8_t board_code = BOARD_ESP32;
const uint8_t board_analogs = 8;
const uint8_t board_first_analog = 32;
const uint8_t board_sda = 21;
const uint8_t board_scl = 22;

#define PINS 40
#define BITS(pin) (1ULL << (pin))
/* Pins of the flash memory, and those that no board has. */
static const uint64_t missing = 0x3FULL << 6 | BITS(20) | BITS(24) | 0xFULL << 28;
static const uint64_t link_pins = BITS(1) | BITS(3);
static const uint64_t only_analog = 0x3FULL << 34; /* they have neither an output nor a pull-up */

static uint8_t numbers[PINS];

bool board_pin(uint8_t number, pin_t *pin)
{
    if (number >= PINS || missing & BITS(number))
        return false;
    bool plain = (link_pins | only_analog) & BITS(number);
    numbers[number] = number;
    pin->bit.at = &numbers[number];
    pin->bit.mask = !(only_analog & BITS(number));
    pin->pwm = plain ? BOARD_NOTHING : number;
    pin->interrupt = link_pins & BITS(number) ? BOARD_LINK : plain ? BOARD_NOTHING : number;
    return true;
}

void board_write(const bit_t *bit, uint8_t offset, bool high)
{
    if (offset == offset_of_direction)
        pinMode(*bit->at, high ? OUTPUT : INPUT);
    else
        digitalWrite(*bit->at, high);
}

bool board_read(const bit_t *bit)
{
    return bit->at && digitalRead(*bit->at); /* no pin before there are settings */
}

bool board_input(uint8_t number, bit_t *bit)
{
    pin_t pin;
    if (!board_pin(number, &pin))
        return false;
    *bit = pin.bit;
    pinMode(number, INPUT_PULLUP);
    return true;
}

void board_release_input(const bit_t *bit)
{
    pinMode(*bit->at, INPUT);
}

void board_pwm(uint8_t number, pwm_t *output)
{
    numbers[number] = number;
    output->compare = &numbers[number];
}

/* 8 bits at 1 kHz, the core's default. */
void board_set_duty(const bit_t *pin, const pwm_t *, uint8_t duty)
{
    analogWrite(*pin->at, duty);
}

void board_start_timers(void)
{
}

/* Interrupts are attached and detached by board_sleep: the core's functions for it must run neither in an
   interrupt nor with interrupts off. Meanwhile `sensed` decides which edges count. */
static volatile uint8_t sensed[PINS]; /* EDGE_..., 0 for none */
static bool attached[PINS];
static const bit_t *volatile watched;

static bool is_needed(uint8_t number)
{
    return sensed[number] || (watched && *watched->at == number);
}

static void IRAM_ATTR pin_changed(void *argument)
{
    uint8_t number = *(const uint8_t *)argument;
    uint8_t edge = digitalRead(number) ? EDGE_RISING : EDGE_FALLING;
    if (watched && *watched->at == number)
        ranges_changed();
    else if (sensed[number] == edge || sensed[number] == EDGE_BOTH)
        encoders_edge(number == LEFT->encoder.interrupt ? &LEFT->encoder : &RIGHT->encoder);
}

static void attach_pins(void)
{
    for (uint8_t number = 0; number < PINS; number++) {
        if (is_needed(number) == attached[number])
            continue;
        attached[number] = !attached[number];
        if (attached[number])
            attachInterruptArg(number, pin_changed, &numbers[number], CHANGE);
        else
            detachInterrupt(number);
    }
}

void board_mute(uint8_t number)
{
    if (number < PINS)
        sensed[number] = 0;
}

void board_mute_all(void)
{
    for (uint8_t number = 0; number < PINS; number++)
        sensed[number] = 0;
    watched = 0;
}

void board_sense(uint8_t number, uint8_t sense)
{
    if (number < PINS)
        sensed[number] = sense;
}

uint8_t board_group(const bit_t *bit)
{
    return bit->mask ? 0 : NO_GROUP;
}

void board_watch(const bit_t *bit)
{
    watched = bit;
}

#define WATCHDOG_MS 250
static volatile uint16_t unfed_ms;

/* The motors are off after 100 ms without the main loop. The chip's own watchdog has other times. */
static void IRAM_ATTR millisecond(void)
{
    clock_millisecond();
    if (reset_hung())
        wheels_release();
    if (++unfed_ms > WATCHDOG_MS)
        abort(); /* which resets the chip */
}

void board_feed(void)
{
    unfed_ms = 0;
}

void board_start_watchdog(void)
{
    board_feed();
}

void board_start_clock(void)
{
    hw_timer_t *timer = timerBegin(1000000);
    timerAttachInterrupt(timer, millisecond);
    timerAlarm(timer, 1000, true, 0);
}

ticks_t board_now(void)
{
    return (ticks_t)(esp_timer_get_time() >> 2);
}

uint16_t board_now_low(void)
{
    return (uint16_t)board_now();
}

/* The timer interrupts every millisecond, and board_sleep looks for samples. */
void board_alarm(uint8_t, uint16_t)
{
}

uint32_t esp32_lock(void)
{
    return portSET_INTERRUPT_MASK_FROM_ISR();
}

void esp32_unlock(uint32_t state)
{
    portCLEAR_INTERRUPT_MASK_FROM_ISR(state);
}

static const uint32_t bauds[] = {9600, 19200, 38400, 57600, 115200};
static bool sends;

void board_start_link(uint8_t, uint8_t baud)
{
    Serial.begin(bauds[baud]);
}

void board_set_baud(uint8_t, uint8_t baud)
{
    Serial.updateBaudRate(bauds[baud]);
}

uint8_t board_received(uint8_t)
{
    return (uint8_t)Serial.read();
}

void board_send(uint8_t, uint8_t byte)
{
    Serial.write(byte);
}

void board_sending(uint8_t, bool on)
{
    sends = on;
}

static volatile bool converts;
static uint8_t channel;

/* In board_sleep: the core's function must not run in an interrupt. */
void board_convert(uint8_t next_channel)
{
    channel = next_channel;
    converts = true;
}

/* On the scale of the other boards, 10 bits for 5 V. */
uint16_t board_converted(void)
{
    return (uint16_t)(analogReadMilliVolts(board_first_analog + channel) * 1023 / 5000);
}

uint8_t board_reset_cause(void)
{
    switch (esp_reset_reason()) {
    case ESP_RST_POWERON:
        return RESET_POWER;
    case ESP_RST_BROWNOUT:
        return RESET_BROWNOUT;
    case ESP_RST_PANIC:
    case ESP_RST_INT_WDT:
    case ESP_RST_TASK_WDT:
    case ESP_RST_WDT:
        return RESET_WATCHDOG;
    case ESP_RST_EXT:
        return RESET_LINE;
    default:
        return RESET_UNKNOWN;
    }
}

void board_paint_stack(void)
{
}

uint16_t board_free_stack(void)
{
    return (uint16_t)uxTaskGetStackHighWaterMark(0);
}

void board_start_interrupts(void)
{
}

/* What the interrupts of the other boards do, and a millisecond for the core's own tasks. */
void board_sleep(void)
{
    attach_pins();
    if (clock_sample())
        analog_convert();
    while (converts) {
        converts = false;
        analog_converted(); /* begins the next input, if there is one */
    }
    while (Serial.available() > 0)
        link_received(0);
    while (sends && Serial.availableForWrite() > 0)
        link_empty(0);
    if (LEFT->speed.duty == 0 && RIGHT->speed.duty == 0)
        esp32_save();
    delay(1);
}
}
