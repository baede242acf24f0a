/* Generated from firmware/protocol.yaml by firmware/generate.py: change those. */
#ifndef PROTOCOL_H
#define PROTOCOL_H

#include <stdint.h>

#include "progmem.h"

#define PROTOCOL_VERSION 3
#define CHECK_POLYNOMIAL 0x5D6DCBUL
#define CHECK_START 0xFEDCBAUL
#define CHECK_BYTES 3
#define TICK_NANOSECONDS 64000
#define SPEED_ONE 256
#define DUTY_ONE 32767
#define REPORTED_DUTY_ONE 127
#define GAIN_ONE 32768
#define INTEGRAL_ONE 5243
#define GAIN_MAXIMUM 24576
#define COMMAND_AGE_NANOSECONDS 128000
#define AGE_NONE 65535
#define COMMAND_AGE_NONE 4095
#define ANALOG_ONE 4092
#define ANALOG_NONE 4095
#define PIN_NONE 255
#define DEADMAN_MINIMUM 100
#define DEADMAN_MAXIMUM 500
#define TELEMETRY_MAXIMUM 100
#define GLITCH_MAXIMUM 50000
#define GLITCH_MINIMUM 50
#define SLOTS_MAXIMUM 65535
#define FLAG_STORED 16
#define FLAG_BUTTON 32
#define FLAG_LEFT_STALL 64
#define FLAG_RIGHT_STALL 128
#define FLAG_LEFT_STORM 256
#define FLAG_RIGHT_STORM 512
#define FLAG_BATTERY 1024
#define FLAG_GYRO_SILENT 2048
#define FLAG_GYRO_BUS 4096
#define FLAG_GYRO_STUCK 8192
#define FLAG_GYRO_RANGE 16384
#define FLAG_GYRO_GRAVITY 32768
#define RECEIVE_MOST 96
#define RANGE_MASK 16383
#define RANGE_NOTHING 16383
#define RANGE_SILENT 16382
#define RANGE_ENDLESS 16381
#define ECHO_NANOSECONDS 4000
#define RANGE_AGE_NANOSECONDS 4000000
#define RANGE_TURN_NANOSECONDS 51000000
#define RANGE_SENSORS 4
#define TURN_NANODEGREES 9770992
#define TURN_LSM6_NANODEGREES 11200000
#define GYRO_LSM6 3
#define GYRO_MAXIMUM 500
#define CAPTURE_EDGES 8
#define CAPTURE_TIME 16383
#define PAYLOAD_LONGEST 58

enum { MODE_UNSET = 0, MODE_STOPPED = 1, MODE_SPEED = 2, MODE_DUTY = 3, MODE_EXPIRED = 4, MODE_FAULT = 5, MODE_OVERRULED = 6, MODE_BUTTON = 7, MODE_BATTERY = 8 };
enum { RESET_UNKNOWN = 0, RESET_POWER = 1, RESET_LINE = 2, RESET_BROWNOUT = 3, RESET_WATCHDOG = 4 };
enum { REFUSAL_NONE = 0, REFUSAL_MOVING = 1, REFUSAL_PIN_MISSING = 2, REFUSAL_PIN_LINK = 3, REFUSAL_PIN_PWM = 4, REFUSAL_PIN_INTERRUPT = 5, REFUSAL_PIN_ANALOG = 6, REFUSAL_PIN_TWICE = 7, REFUSAL_RANGE = 8, REFUSAL_OWNED = 9, REFUSAL_UNKNOWN = 10 };
enum { ITEM_UPTIME = 0, ITEM_FLAGS = 1, ITEM_BATTERY = 2, ITEM_FREE_STACK = 3, ITEM_LOOP = 4, ITEM_LEFT_REJECTED = 5, ITEM_RIGHT_REJECTED = 6, ITEM_DAMAGED = 7, ITEM_FOREIGN = 8, ITEM_DROPPED = 9 };
enum { ACTION_LIGHT = 0, ACTION_CLEAR = 1, ACTION_CAPTURE = 2 };
enum { BOARD_UNKNOWN = 0, BOARD_MEGA2560 = 1, BOARD_ATMEGA328P = 2, BOARD_RP2040 = 3, BOARD_ESP32 = 4 };
enum { CAPABILITY_EDGE_TIMES = 0, CAPABILITY_CAPTURE = 1, CAPABILITY_STORMS = 2, CAPABILITY_BATTERY_STOP = 3, CAPABILITY_QUADRATURE = 4, CAPABILITY_EVERY_EDGE = 5, CAPABILITY_ENABLE_IN1_IN2 = 8, CAPABILITY_ENABLE_DIRECTION = 9, CAPABILITY_TWO_PWM = 10, CAPABILITY_STANDBY = 11, CAPABILITY_PULSED_INPUTS = 12, CAPABILITY_ANALOG_RANGE = 16, CAPABILITY_ECHO_RANGE = 17, CAPABILITY_SEVERAL_RANGES = 18, CAPABILITY_MPU6050 = 24, CAPABILITY_LSM6 = 25, CAPABILITY_GRAVITY = 26 };
enum { UPWARD_UNCHECKED = 0, UPWARD_UP = 1, UPWARD_DOWN = 2 };
enum { DRIVER_ENABLE_IN1_IN2 = 0, DRIVER_ENABLE_DIRECTION = 1, DRIVER_TWO_PWM = 2, DRIVER_PULSED_INPUTS = 3 };
enum { EDGE_BOTH = 1, EDGE_FALLING = 2, EDGE_RISING = 3 };
enum { BAUD_B9600 = 0, BAUD_B19200 = 1, BAUD_B38400 = 2, BAUD_B57600 = 3, BAUD_B115200 = 4 };

/* wheel speeds; 10 bytes on the wire */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t sequence : 4; /* sequence number of this command */
    int16_t left; /* 1/256 rad/s */
    int16_t right; /* 1/256 rad/s */
} command_t;
enum { TYPE_COMMAND = 1 };
_Static_assert(sizeof(command_t) == 5, "the structure is the payload");

/* raw duty for identification */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t sequence : 4; /* sequence number of this command */
    int16_t left; /* 1/32767 */
    int16_t right; /* 1/32767 */
} duty_t;
enum { TYPE_DUTY = 2 };
_Static_assert(sizeof(duty_t) == 5, "the structure is the payload");

/* motors off; also claims the commands when no link owns them; 6 bytes on the wire */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t sequence : 4; /* sequence number of this command */
} stop_t;
enum { TYPE_STOP = 3 };
_Static_assert(sizeof(stop_t) == 1, "the structure is the payload");

/* requests a hello, and telemetry from now on */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t version : 4; /* the host's protocol version */
} ask_t;
enum { TYPE_ASK = 4 };
_Static_assert(sizeof(ask_t) == 1, "the structure is the payload");

/* one action of the board */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t action : 4; /* code */
    uint8_t value; /* its argument */
} action_t;
enum { TYPE_ACTION = 5 };
_Static_assert(sizeof(action_t) == 2, "the structure is the payload");

/* all settings of the robot; also the content of an EEPROM slot */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t edge : 2; /* which edges count */
    uint8_t edge_times : 1; /* state frames rather than counts frames */
    uint8_t brake : 1; /* brake at rest rather than coast */
    uint8_t left_reversed : 1; /* in1 high turns the wheel backwards */
    uint8_t right_reversed : 1; /* in1 high turns the wheel backwards */
    uint8_t left_encoder_reversed : 1; /* quadrature counts down going forward */
    uint8_t right_encoder_reversed : 1; /* quadrature counts down going forward */
    uint8_t enable_inverted : 1; /* the driver is enabled by a low level */
    uint8_t button_high : 1; /* pressed is high (a normally closed contact to ground) */
    uint8_t every_edge : 1; /* two channels: all four edges of a slot count, not one */
    uint8_t reserved : 1; /* zero */
    uint8_t baud; /* of UART1 */
    uint8_t driver; /* code */
    uint8_t left_enable; /* pin with PWM */
    uint8_t left_in1; /* pin */
    uint8_t left_in2; /* pin */
    uint8_t left_encoder; /* pin with an interrupt */
    uint8_t left_encoder_b; /* pin of the second channel, or none */
    uint8_t right_enable; /* pin with PWM */
    uint8_t right_in1; /* pin */
    uint8_t right_in2; /* pin */
    uint8_t right_encoder; /* pin with an interrupt */
    uint8_t right_encoder_b; /* pin of the second channel, or none */
    uint8_t button; /* pin of the stop button, or none */
    uint8_t range; /* analog channel (A0 is 0), or none */
    uint8_t battery; /* analog channel, or none */
    uint16_t telemetry; /* Hz */
    uint16_t left_slots; /* counts per turn of the wheel */
    uint16_t right_slots; /* counts per turn of the wheel */
    uint16_t glitch; /* us that a level must last for the edge at its end to count */
    uint16_t deadman; /* ms */
    uint16_t battery_low; /* analog reading below which the battery is low; 0: never */
    uint16_t left_start; /* duty that just moves the wheel, 1/32768 */
    uint16_t left_gain; /* duty per rad/s, 1/32768 */
    uint16_t left_proportional; /* duty per rad/s of error, 1/32768 */
    uint16_t left_integral; /* duty per rad of error, 1/INTEGRAL_ONE */
    uint16_t right_start; /* duty that just moves the wheel, 1/32768 */
    uint16_t right_gain; /* duty per rad/s, 1/32768 */
    uint16_t right_proportional; /* duty per rad/s of error, 1/32768 */
    uint16_t right_integral; /* duty per rad of error, 1/INTEGRAL_ONE */
    uint8_t standby; /* pin of the standby input, counted from 1; 0: none */
    uint8_t trigger_1; /* pin, counted from 1, of sensor 1 in range frames; 0: analog */
    uint8_t input_1; /* its echo pin or analog channel, counted from 1; 0: no sensor */
    uint8_t trigger_2; /* pin, counted from 1, of sensor 2 in range frames; 0: analog */
    uint8_t input_2; /* its echo pin or analog channel, counted from 1; 0: no sensor */
    uint8_t trigger_3; /* pin, counted from 1, of sensor 3 in range frames; 0: analog */
    uint8_t input_3; /* its echo pin or analog channel, counted from 1; 0: no sensor */
    uint8_t trigger_4; /* pin, counted from 1, of sensor 4 in range frames; 0: analog */
    uint8_t input_4; /* its echo pin or analog channel, counted from 1; 0: no sensor */
    uint8_t gyro_address; /* I2C address of the gyro; 0: none */
    uint8_t gyro_axis; /* its axis that is read: 0 x, 1 y, 2 z; those of an LSM6 from GYRO_LSM6 on */
    uint8_t lag; /* of the slower motor, 10 ms; 0: unknown */
    uint8_t gyro_upward; /* where the axis of the gyro points: code */
} settings_t;
enum { TYPE_SETTINGS = 6 };
_Static_assert(sizeof(settings_t) == 58, "the structure is the payload");
enum { FIELD_EDGE, FIELD_EDGE_TIMES, FIELD_BRAKE, FIELD_LEFT_REVERSED, FIELD_RIGHT_REVERSED, FIELD_LEFT_ENCODER_REVERSED, FIELD_RIGHT_ENCODER_REVERSED, FIELD_ENABLE_INVERTED, FIELD_BUTTON_HIGH, FIELD_EVERY_EDGE, FIELD_RESERVED, FIELD_BAUD, FIELD_DRIVER, FIELD_LEFT_ENABLE, FIELD_LEFT_IN1, FIELD_LEFT_IN2, FIELD_LEFT_ENCODER, FIELD_LEFT_ENCODER_B, FIELD_RIGHT_ENABLE, FIELD_RIGHT_IN1, FIELD_RIGHT_IN2, FIELD_RIGHT_ENCODER, FIELD_RIGHT_ENCODER_B, FIELD_BUTTON, FIELD_RANGE, FIELD_BATTERY, FIELD_TELEMETRY, FIELD_LEFT_SLOTS, FIELD_RIGHT_SLOTS, FIELD_GLITCH, FIELD_DEADMAN, FIELD_BATTERY_LOW, FIELD_LEFT_START, FIELD_LEFT_GAIN, FIELD_LEFT_PROPORTIONAL, FIELD_LEFT_INTEGRAL, FIELD_RIGHT_START, FIELD_RIGHT_GAIN, FIELD_RIGHT_PROPORTIONAL, FIELD_RIGHT_INTEGRAL, FIELD_STANDBY, FIELD_TRIGGER_1, FIELD_INPUT_1, FIELD_TRIGGER_2, FIELD_INPUT_2, FIELD_TRIGGER_3, FIELD_INPUT_3, FIELD_TRIGGER_4, FIELD_INPUT_4, FIELD_GYRO_ADDRESS, FIELD_GYRO_AXIS, FIELD_LAG, FIELD_GYRO_UPWARD };

/* both wheels at one time, with the ages of their last edges */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t boot : 4; /* changes at each restart */
    uint8_t sequence : 6; /* sequence number of frames of this type */
    uint8_t dropped : 1; /* a frame was dropped since the last one */
    uint8_t level : 1; /* of a pin: of the left encoder in frames of even sequence, else of the right one */
    uint8_t mode : 4; /* code */
    uint16_t command_age : 12; /* 128 us */
    uint16_t time; /* 64 us, low bits */
    uint16_t left; /* low bits of the count */
    uint16_t right; /* low bits of the count */
    uint16_t range : 12; /* the analog sensor, mean of 16 readings */
    uint8_t command : 4; /* sequence number of the command in force */
    int8_t duty; /* 1/127; of the left motor in frames of even sequence, else of the right */
    uint16_t left_age; /* 64 us */
    uint16_t right_age; /* 64 us */
} state_t;
enum { TYPE_STATE = 8 };
_Static_assert(sizeof(state_t) == 17, "the structure is the payload");

/* a state frame with the turn that a gyro has measured */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t boot : 4; /* changes at each restart */
    uint8_t sequence : 6; /* sequence number of frames of this type */
    uint8_t dropped : 1; /* a frame was dropped since the last one */
    uint8_t turn_fault : 1; /* the turn is wrong or was wrong lately: bits FLAG_GYRO_... */
    uint8_t mode : 4; /* code */
    uint16_t command_age : 12; /* 128 us */
    uint16_t time; /* 64 us, low bits */
    uint16_t left; /* low bits of the count */
    uint16_t right; /* low bits of the count */
    uint16_t range : 12; /* the analog sensor, mean of 16 readings */
    uint8_t command : 4; /* sequence number of the command in force */
    int8_t duty; /* 1/127; of the left motor in frames of even sequence, else of the right */
    uint16_t left_age; /* 64 us */
    uint16_t right_age; /* 64 us */
    uint16_t turn; /* about the axis of the settings since the start, TURN_NANODEGREES, low bits */
} inertial_t;
enum { TYPE_INERTIAL = 7 };
_Static_assert(sizeof(inertial_t) == 19, "the structure is the payload");

/* a state frame without the ages, for 48 Hz */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t boot : 4; /* changes at each restart */
    uint8_t sequence : 6; /* sequence number of frames of this type */
    uint8_t dropped : 1; /* a frame was dropped since the last one */
    uint8_t level : 1; /* of a pin: of the left encoder in frames of even sequence, else of the right one */
    uint8_t mode : 4; /* code */
    uint16_t command_age : 12; /* 128 us */
    uint16_t time; /* 64 us, low bits */
    uint16_t left; /* low bits of the count */
    uint16_t right; /* low bits of the count */
    uint16_t range : 12; /* the analog sensor, mean of 16 readings */
    uint8_t command : 4; /* sequence number of the command in force */
    int8_t duty; /* 1/127; of the left motor in frames of even sequence, else of the right */
} counts_t;
enum { TYPE_COUNTS = 9 };
_Static_assert(sizeof(counts_t) == 13, "the structure is the payload");

/* one of the slowly changing values, in turn, so that it delays no state frame much */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t item : 4; /* code */
    uint16_t value; /* its value */
} status_t;
enum { TYPE_STATUS = 10 };
_Static_assert(sizeof(status_t) == 3, "the structure is the payload");

/* identity of the board and its state */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t boot : 4; /* changes at each restart */
    uint8_t version; /* of the protocol */
    uint8_t major; /* of the firmware */
    uint8_t minor; /* of the firmware */
    uint8_t patch; /* of the firmware */
    uint8_t board; /* code */
    uint8_t reset : 4; /* code */
    uint8_t mode : 4; /* code */
    uint8_t uart; /* UART that sends this frame */
    uint32_t settings; /* checksum of the settings in use, 0: none */
    uint8_t receive; /* bytes of the longest payload that the board takes */
    uint8_t settings_size; /* bytes of the settings frame that the board knows */
    uint32_t capabilities; /* bits: codes of `capability` */
} hello_t;
enum { TYPE_HELLO = 11 };
_Static_assert(sizeof(hello_t) == 18, "the structure is the payload");

/* reply to the settings */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t refusal : 4; /* code */
    uint8_t field; /* index of the refused field in the settings frame */
    uint32_t settings; /* checksum of the settings now in use, 0: none */
} answer_t;
enum { TYPE_ANSWER = 12 };
_Static_assert(sizeof(answer_t) == 6, "the structure is the payload");

/* a measurement of one of the further distance sensors, as soon as it is done */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t sensor : 2; /* its index in the settings */
    uint16_t value : 14; /* length of its echo in 4 us, or its analog reading plus 1; or RANGE_... */
    uint8_t age : 4; /* since the trigger, 4 ms */
} range_t;
enum { TYPE_RANGE = 14 };
_Static_assert(sizeof(range_t) == 3, "the structure is the payload");

/* raw edges, rising and falling, unfiltered */
typedef struct __attribute__((packed)) {
    uint8_t type : 4;
    uint8_t used : 4; /* number of edges */
    uint8_t sequence : 6; /* sequence number of frames of this type */
    uint8_t lost : 1; /* edges were lost */
    uint8_t reserved : 1; /* zero */
    uint32_t time; /* of this frame, 64 us, low 20 bits; no edge in it is a second old */
    uint16_t edges[8]; /* wheel (1 bit, 0 left), level (1 bit), low 14 bits of its time in 64 us */
} capture_t;
enum { TYPE_CAPTURE = 13 };
_Static_assert(sizeof(capture_t) == 22, "the structure is the payload");

#ifndef __cplusplus /* C++ has no such initializer */
/* Payload length of a type; 0 when there is no such type. */
static inline uint8_t payload_size(uint8_t type)
{
    static const uint8_t sizes[16] PROGMEM = {
        [TYPE_COMMAND] = sizeof(command_t),
        [TYPE_DUTY] = sizeof(duty_t),
        [TYPE_STOP] = sizeof(stop_t),
        [TYPE_ASK] = sizeof(ask_t),
        [TYPE_ACTION] = sizeof(action_t),
        [TYPE_SETTINGS] = sizeof(settings_t),
        [TYPE_STATE] = sizeof(state_t),
        [TYPE_INERTIAL] = sizeof(inertial_t),
        [TYPE_COUNTS] = sizeof(counts_t),
        [TYPE_STATUS] = sizeof(status_t),
        [TYPE_HELLO] = sizeof(hello_t),
        [TYPE_ANSWER] = sizeof(answer_t),
        [TYPE_RANGE] = sizeof(range_t),
        [TYPE_CAPTURE] = sizeof(capture_t),
    };
    return pgm_read_byte(&sizes[type]);
}
#endif

#endif
