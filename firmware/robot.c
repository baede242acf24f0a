#include "robot.h"

#include <util/atomic.h>

#include "analog.h"
#include "board.h"
#include "clock.h"
#include "codec.h"
#include "deadman.h"
#include "link.h"
#include "reset.h"
#include "settings.h"
#include "store.h"
#include "telemetry.h"
#include "wheel.h"

#define VERSION_MAJOR 0
#define VERSION_MINOR 1
#define VERSION_PATCH 0
#define LIGHT_PIN 13
/* Loop periods without an edge after which the wheels stand still: 300 ms. */
#define REST_PERIODS (300 / SPEED_PERIOD_MS)
/* Time that the button must be pressed, so that motor noise is not taken for a press. */
#define PRESS_MS 3

static deadman_t deadman;
static settings_t settings;
static uint32_t settings_mark; /* checksum of the settings in use; 0 without */
static uint32_t limit; /* dead-man timeout, ticks */
static uint8_t faults; /* FLAG_... */
static uint8_t period_ms, press_ms, rest;
static bit_t button; /* mask 0: no button */

static void release(void)
{
    for (wheel_t *wheel = LEFT; wheel <= RIGHT; wheel++) {
        speed_stop(&wheel->speed);
        encoders_forget(&wheel->encoder);
        motors_set(&wheel->motor, 0);
    }
}

/* Applies the settings of one wheel: its pins, from `enable` on, and its gains. */
static void use_wheel(wheel_t *wheel, const uint8_t *pins, uint16_t start, uint16_t gain)
{
    speed_t *speed = &wheel->speed;
    speed->start = start;
    speed->gain = gain;
    speed->proportional = settings.proportional;
    speed->integral = settings.integral;
    speed->pitch = speed_pitch(settings.slots);
    wheel->motor.inverted = settings.enable_inverted;
    wheel->motor.brake = settings.brake;
    motors_configure(&wheel->motor, pins);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) encoders_connect(&wheel->encoder, pins + MOTOR_PINS);
}

static void use(void)
{
    wheels_release(); /* motors off, with the old pins */
    settings_mark = codec_check(&settings, sizeof settings);
    limit = (uint32_t)settings.deadman * TICKS_PER_MS;
    encoders_configure(&settings);
    LEFT->motor.reversed = settings.left_reversed;
    LEFT->encoder.reversed = settings.left_encoder_reversed;
    use_wheel(LEFT, &settings.left_enable, settings.left_start, settings.left_gain);
    RIGHT->motor.reversed = settings.right_reversed;
    RIGHT->encoder.reversed = settings.right_encoder_reversed;
    RIGHT->encoder.wheel = 1;
    use_wheel(RIGHT, &settings.right_enable, settings.right_start, settings.right_gain);
    analog_configure(&settings);
    telemetry_configure(&settings);
    if (!board_input(settings.button, &button))
        button.mask = 0;
    link_baud(1, settings.baud);
    faults = 0;
    release();
    deadman_ready(&deadman);
}

/* Applies new settings, or returns the refusal and the field that causes it. */
static uint8_t take(uint8_t link, const settings_t *wanted, uint8_t *field)
{
    *field = 0;
    if (!deadman_allows(&deadman, link))
        return REFUSAL_OWNED;
    if (settings_mark != 0) {
        if (codec_check(wanted, sizeof *wanted) == settings_mark)
            return REFUSAL_NONE; /* unchanged; the host, too, identifies settings by their checksum */
        if (rest < REST_PERIODS)
            return REFUSAL_MOVING;
    }
    uint8_t refusal = settings_check(wanted, field);
    if (refusal != REFUSAL_NONE)
        return refusal;
    store_begin(wanted);
    settings = *wanted;
    use();
    return REFUSAL_NONE;
}

static void answer(uint8_t link, const void *payload)
{
    uint8_t field;
    answer_t frame = {.type = TYPE_ANSWER};
    frame.refusal = take(link, payload, &field);
    frame.field = field;
    frame.settings = settings_mark;
    link_send(link, &frame, sizeof frame);
}

static void hello(uint8_t link)
{
    hello_t frame = {
        .type = TYPE_HELLO, .version = PROTOCOL_VERSION,
        .major = VERSION_MAJOR, .minor = VERSION_MINOR, .patch = VERSION_PATCH,
    };
    frame.boot = reset_boot();
    frame.board = board_code;
    frame.reset = reset_cause;
    frame.mode = deadman.mode;
    frame.uart = link;
    frame.settings = settings_mark;
    link_send(link, &frame, sizeof frame);
}

void robot_start(void)
{
    uint8_t field;
    deadman_begin(&deadman);
    if (store_load(&settings) && settings_check(&settings, &field) == REFUSAL_NONE)
        use();
    link_tick();
    for (uint8_t link = 0; link < LINKS; link++)
        hello(link); /* informs a host that was driving of the restart */
}

/* Updates a wheel's duty; `passed` as in speed_step. */
static void power(wheel_t *wheel, bool passed)
{
    if (deadman.mode == MODE_SPEED)
        speed_step(&wheel->speed, encoders_period(&wheel->encoder), passed);
    motors_set(&wheel->motor, wheel->speed.duty);
}

static void drive_wheel(wheel_t *wheel, int16_t wanted)
{
    encoders_set_direction(&wheel->encoder, wanted);
    if (deadman.mode == MODE_DUTY)
        wheel->speed.duty = wanted;
    else if (speed_command(&wheel->speed, wanted))
        encoders_forget(&wheel->encoder);
    power(wheel, false);
}

/* A command and a duty frame have the same layout. */
static void drive(uint8_t link, const command_t *frame)
{
    uint8_t mode = frame->type == TYPE_DUTY ? MODE_DUTY : MODE_SPEED;
    uint8_t before = deadman.mode;
    if (!deadman_command(&deadman, link, mode, frame->sequence, clock_now()))
        return;
    if (mode != before)
        release();
    drive_wheel(LEFT, frame->left);
    drive_wheel(RIGHT, frame->right);
}

/* Pin 13 is the LED unless the settings use it. */
static void light(uint8_t how)
{
    static bool lit;
    pin_t pin;
    for (const uint8_t *at = &settings.left_enable; at < &settings.range; at++)
        if (*at == LIGHT_PIN)
            return;
    board_pin(LIGHT_PIN, &pin);
    lit = how == 2 ? !lit : how;
    board_write(&pin.bit, DIRECTION, true);
    board_write(&pin.bit, OUTPUT, lit);
}

static void act(uint8_t link, const action_t *frame)
{
    if (frame->action == ACTION_LIGHT)
        light(frame->value);
    if (!deadman_allows(&deadman, link))
        return;
    if (frame->action == ACTION_CLEAR) {
        faults = 0;
        deadman_clear(&deadman);
    }
    if (frame->action == ACTION_CAPTURE)
        telemetry_capture(frame->value);
}

void robot_handle(uint8_t link, const void *payload)
{
    const stop_t *frame = payload; /* every frame to the board has type and sequence here */
    switch (frame->type) {
    case TYPE_COMMAND:
    case TYPE_DUTY:
        drive(link, payload);
        break;
    case TYPE_STOP:
        release();
        deadman_stop(&deadman, link, frame->sequence, clock_now());
        break;
    case TYPE_ASK:
        hello(link);
        break;
    case TYPE_ACTION:
        act(link, payload);
        break;
    case TYPE_SETTINGS:
        answer(link, payload);
        break;
    default:
        break; /* frames of a board: the line echoes */
    }
}

static void check_button(void)
{
    bool pressed = false;
    if (button.mask) {
        pressed = board_read(&button) == settings.button_high;
    }
    if (!pressed)
        press_ms = 0;
    else if (press_ms < PRESS_MS)
        press_ms++;
    deadman_button(&deadman, press_ms == PRESS_MS);
}

static void loop(void)
{
    if (rest < REST_PERIODS)
        rest++;
    for (wheel_t *wheel = LEFT; wheel <= RIGHT; wheel++) {
        bool edge = wheel->encoder.moved;
        wheel->encoder.moved = false; /* an edge between these lines is missed here */
        power(wheel, true);
        if (edge || wheel->speed.duty != 0)
            rest = 0;
        if (speed_stalled(&wheel->speed, edge)) {
            faults |= wheel == LEFT ? FLAG_LEFT_FAULT : FLAG_RIGHT_FAULT;
            deadman_fault(&deadman);
        }
    }
}

void robot_tick(void)
{
    bool drove = deadman_drives(&deadman);
    check_button();
    deadman_tick(&deadman, limit, clock_now());
    if (++period_ms == SPEED_PERIOD_MS) {
        period_ms = 0;
        loop();
    }
    if (drove && !deadman_drives(&deadman))
        release();
    store_tick();
    link_tick();
    telemetry_tick(&deadman, faults);
}
