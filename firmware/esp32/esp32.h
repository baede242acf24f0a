/* What the files of the ESP32 share beside board.h. */
#ifndef ESP32_H
#define ESP32_H

/* Before everything else. */
void esp32_begin(void);

/* Writes changed settings to the flash memory, which stops the program for tens of milliseconds. To be
   called only while the motors are off. */
void esp32_save(void);

#endif
