/* Imitation of the Arduino core of the ESP32, as far as the sketch uses it. Time goes on in `delay` alone. */
#ifndef ARDUINO_H
#define ARDUINO_H

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#define HIGH 1
#define LOW 0
#define INPUT 0x01
#define OUTPUT 0x03
#define INPUT_PULLUP 0x05
#define RISING 0x01
#define FALLING 0x02
#define CHANGE 0x03
#define IRAM_ATTR

#define PROGMEM
#define pgm_read_byte(at) (*(const uint8_t *)(at))
#define pgm_read_word(at) (*(const uint16_t *)(at))

void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t level);
int digitalRead(uint8_t pin);
void analogWrite(uint8_t pin, int duty);
uint32_t analogReadMilliVolts(uint8_t pin);
void attachInterruptArg(uint8_t pin, void (*handler)(void *), void *argument, int mode);
void detachInterrupt(uint8_t pin);
unsigned long millis(void);
void delay(uint32_t ms);

typedef struct hw_timer_s hw_timer_t;
hw_timer_t *timerBegin(uint32_t frequency);
void timerAttachInterrupt(hw_timer_t *timer, void (*handler)(void));
void timerAlarm(hw_timer_t *timer, uint64_t alarm_value, bool autoreload, uint64_t reload_count);

uint32_t mock_mask(void);
void mock_unmask(uint32_t state);
#define portSET_INTERRUPT_MASK_FROM_ISR() mock_mask()
#define portCLEAR_INTERRUPT_MASK_FROM_ISR(state) mock_unmask(state)
unsigned uxTaskGetStackHighWaterMark(void *task);

class HardwareSerial {
public:
    void begin(unsigned long baud);
    void updateBaudRate(unsigned long baud);
    int available(void);
    int availableForWrite(void);
    int read(void);
    size_t write(uint8_t byte);
};
extern HardwareSerial Serial;

#endif
