#include "robot.h"

#include <stddef.h>

#include "analog.h"
#include "atomic.h"
#include "battery.h"
#include "board.h"
#include "codec.h"
#include "deadman.h"
#include "gyro.h"
#include "link.h"
#include "ranges.h"
#include "reset.h"
#include "settings.h"
#include "store.h"
#include "telemetry.h"
#include "wheel.h"

#define VERSION_MAJOR 0
#define VERSION_MINOR 2
#define VERSION_PATCH 0
#define BIT(capability) (1UL << (capability))
#define CAPABILITIES \
    (BIT(CAPABILITY_EDGE_TIMES) | BIT(CAPABILITY_CAPTURE) | BIT(CAPABILITY_STORMS) \
     | BIT(CAPABILITY_BATTERY_STOP) | BIT(CAPABILITY_QUADRATURE) | BIT(CAPABILITY_ENABLE_IN1_IN2) \
     | BIT(CAPABILITY_ENABLE_DIRECTION) | BIT(CAPABILITY_TWO_PWM) | BIT(CAPABILITY_STANDBY) \
     | BIT(CAPABILITY_PULSED_INPUTS) \
     | BIT(CAPABILITY_ANALOG_RANGE) | BIT(CAPABILITY_ECHO_RANGE) | BIT(CAPABILITY_SEVERAL_RANGES) \
     | BIT(CAPABILITY_MPU6050) | BIT(CAPABILITY_LSM6) | BIT(CAPABILITY_GRAVITY) \
     | (BOARD_EVERY_EDGE ? BIT(CAPABILITY_EVERY_EDGE) : 0))
/* Loop periods without an edge after which the wheels stand still: 300 ms. */
#define REST_PERIODS (300 / SPEED_PERIOD_MS)
/* Time that the button must be pressed, so that motor noise is not taken for a press. */
#define PRESS_MS 3

static deadman_t deadman;
static battery_t battery;
static settings_t settings;
static uint32_t settings_mark; /* checksum of the settings in use; 0 without */
static uint32_t limit; /* dead-man timeout, ticks */
static uint16_t faults; /* FLAG_... of a fault, until it is cleared */
static uint16_t storms; /* FLAG_... of the storms at present */
static uint8_t period_ms, check_ms, press_ms, rest;
static bit_t button; /* mask 0: no button */

static void release(void)
{
    for (wheel_t *wheel = LEFT; wheel <= RIGHT; wheel++) {
        speed_stop(&wheel->speed);
        motors_set(&wheel->motor, 0);
    }
}

/* Edges per second of a wheel at full duty, rounded up; 0 when the gain does not tell its speed. */
static uint32_t rated_edges(uint16_t slots, const speed_t *speed)
{
    const uint8_t turn = 6; /* rad, rounded down from 2 pi */
    if (speed->gain == 0)
        return 0;
    return (uint32_t)slots * (uint16_t)(DUTY_FULL - speed->start) / (uint16_t)speed->gain / turn + 1;
}

/* Four numbers of the settings, which need not be at an even address. */
typedef struct {
    int16_t start, gain, proportional, integral;
} __attribute__((packed)) gains_t;
#define GAINS(side) ((const gains_t *)((const uint8_t *)&settings + offsetof(settings_t, side##_start)))

/* Applies the settings of one wheel: its pins, from `enable` on. */
static void use_wheel(wheel_t *wheel, const uint8_t *pins, const gains_t *gains, uint16_t slots)
{
    speed_t *speed = &wheel->speed;
    speed->start = gains->start;
    speed->gain = gains->gain;
    speed->proportional = gains->proportional;
    speed->integral = gains->integral;
    speed->pitch = speed_pitch(slots);
    speed->lag = settings.lag;
    wheel->motor.inverted = settings.enable_inverted;
    wheel->motor.brake = settings.brake;
    wheel->motor.driver = settings.driver;
    motors_configure(&wheel->motor, pins);
    uint32_t edges_per_s = rated_edges(slots, speed);
    ATOMIC
        encoders_connect(&wheel->encoder, pins + MOTOR_PINS, edges_per_s);
}

/* Wakes the motor driver. Its input is pulled low while the board has no settings. */
static void wake_driver(void)
{
    pin_t pin;
    if (settings.standby == 0 || !board_pin(settings.standby - 1, &pin))
        return;
    board_write(&pin.bit, OUTPUT, true);
    board_write(&pin.bit, DIRECTION, true);
}

static void use(void)
{
    wheels_release(); /* motors off, with the old pins */
    settings_mark = codec_check(&settings, sizeof settings);
    limit = (uint32_t)settings.deadman * TICKS_PER_MS;
    encoders_configure(&settings);
    gyro_configure(&settings); /* before motors, which may use the pins of a bus without a gyro */
    LEFT->motor.reversed = settings.left_reversed;
    LEFT->encoder.reversed = settings.left_encoder_reversed;
    use_wheel(LEFT, &settings.left_enable, GAINS(left), settings.left_slots);
    RIGHT->motor.reversed = settings.right_reversed;
    RIGHT->encoder.reversed = settings.right_encoder_reversed;
    RIGHT->encoder.wheel = 1;
    use_wheel(RIGHT, &settings.right_enable, GAINS(right), settings.right_slots);
    wake_driver();
    analog_configure(&settings);
    ranges_configure(&settings);
    battery = (battery_t){.low = settings.battery_low};
    telemetry_configure(&settings);
    if (!board_input(settings.button, &button))
        button.mask = 0;
    link_baud(LINK_OF_RATE, settings.baud);
    faults = 0;
    release();
    deadman_ready(&deadman);
}

/* Applies new settings, or returns the refusal and the field that causes it. */
static uint8_t take(uint8_t link, const settings_t *received, uint8_t *field)
{
    *field = 0;
    if (!deadman_allows(&deadman, link))
        return REFUSAL_OWNED;
    if (!settings_known(received, link_size(link), field))
        return REFUSAL_UNKNOWN;
    if (settings_mark != 0) {
        if (codec_check(received, sizeof *received) == settings_mark)
            return REFUSAL_NONE; /* unchanged; the host, too, identifies settings by their checksum */
        if (rest < REST_PERIODS)
            return REFUSAL_MOVING;
    }
    uint8_t refusal = settings_check(received, field);
    if (refusal != REFUSAL_NONE)
        return refusal;
    store_begin(received);
    settings = *received;
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
    frame.receive = RECEIVE_MOST;
    frame.settings_size = sizeof(settings_t);
    frame.capabilities = CAPABILITIES;
    link_delimit(link);
    link_send(link, &frame, sizeof frame);
}

void robot_start(void)
{
    uint8_t field;
    deadman_begin(&deadman);
    if (store_load(&settings) && settings_check(&settings, &field) == REFUSAL_NONE)
        use();
    link_tick(); /* the baud rate of the settings, before the first byte */
    for (uint8_t link = 0; link < LINKS; link++)
        hello(link); /* informs a host that was driving of the restart */
}

static void drive_wheel(wheel_t *wheel, int16_t command)
{
    encoders_set_direction(&wheel->encoder, command);
    if (deadman.mode == MODE_DUTY)
        wheel->speed.duty = command;
    else if (!wheel->encoder.in.at)
        speed_stop(&wheel->speed); /* a speed cannot be kept without an encoder */
    else
        speed_command(&wheel->speed, command, board_now());
    motors_set(&wheel->motor, wheel->speed.duty);
}

/* A command and a duty frame have the same layout. */
static void drive(uint8_t link, const command_t *frame)
{
    uint8_t mode = frame->type == TYPE_DUTY ? MODE_DUTY : MODE_SPEED;
    uint8_t before = deadman.mode;
    if (!deadman_command(&deadman, link, mode, frame->sequence, board_now()))
        return;
    if (mode != before)
        release();
    drive_wheel(LEFT, frame->left);
    drive_wheel(RIGHT, frame->right);
}

/* Its pin is the LED's unless the settings use it. */
static void light(uint8_t how)
{
    static bool lit;
    pin_t pin;
    for (const uint8_t *at = &settings.left_enable; at < &settings.range; at++)
        if (*at == BOARD_LIGHT)
            return;
    if (settings.standby == BOARD_LIGHT + 1)
        return;
    for (uint8_t i = 0; i < RANGE_SENSORS; i++) {
        const uint8_t *pins = settings_range_pins(&settings, i);
        if (pins[0] == BOARD_LIGHT + 1 || (pins[0] != 0 && pins[1] == BOARD_LIGHT + 1))
            return;
    }
    board_pin(BOARD_LIGHT, &pin);
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
        deadman_stop(&deadman, link, frame->sequence, board_now());
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

static void fault(uint16_t flag)
{
    faults |= flag;
    deadman_hold(&deadman, MODE_FAULT);
}

static void loop(void)
{
    if (rest < REST_PERIODS)
        rest++;
    for (wheel_t *wheel = LEFT; wheel <= RIGHT; wheel++) {
        speed_t *speed = &wheel->speed;
        ticks_t last;
        uint16_t edges = encoders_take(&wheel->encoder, &last);
        speed_edges(speed, edges, last);
        if (deadman.mode == MODE_SPEED)
            speed_step(speed, board_now());
        if (rest == REST_PERIODS)
            wheel->motor.held = false;
        motors_set(&wheel->motor, speed->duty);
        if (edges != 0 || speed->duty != 0)
            rest = 0;
        if (!wheel->encoder.in.at)
            continue; /* nothing shows a stall */
        if (deadman_drives(&deadman) && speed_stalled(speed, deadman.mode == MODE_DUTY))
            fault(wheel == LEFT ? FLAG_LEFT_STALL : FLAG_RIGHT_STALL);
    }
}

/* Looks for a low battery. At standstill it is only reported. */
static void watch_battery(void)
{
    battery_check(&battery, analog_mean(1));
    if (battery_must_stop(&battery) && deadman_drives(&deadman))
        deadman_hold(&deadman, MODE_BATTERY);
}

/* Looks for storms at the encoders' pins. At standstill they are only reported: the robot must not drive
   with such an encoder, but it may stand. */
static void watch_encoders(bool check)
{
    storms = 0;
    for (wheel_t *wheel = LEFT; wheel <= RIGHT; wheel++) {
        encoders_tick(&wheel->encoder);
        if (check)
            encoders_check(&wheel->encoder);
        if (storm_present(&wheel->encoder.storm))
            storms |= wheel == LEFT ? FLAG_LEFT_STORM : FLAG_RIGHT_STORM;
    }
    if (storms != 0 && deadman_drives(&deadman))
        fault(storms);
}

void robot_tick(void)
{
    bool drove = deadman_drives(&deadman);
    check_button();
    deadman_tick(&deadman, limit, board_now());
    bool check = ++check_ms == STORM_CHECK_MS;
    if (check) {
        check_ms = 0;
        watch_battery();
    }
    watch_encoders(check);
    if (++period_ms == SPEED_PERIOD_MS) {
        period_ms = 0;
        loop();
    }
    if (drove && !deadman_drives(&deadman))
        release();
    store_tick();
    link_tick();
    gyro_tick();
    uint16_t flags = faults | storms | gyro_faults();
    if (battery_is_low(&battery))
        flags |= FLAG_BATTERY;
    telemetry_tick(&deadman, flags);
}
