/* diffbot on an ESP32, for the Arduino IDE with the core "esp32" 3.x. It has never run on a chip: it is
   compiled and run in the tests against an imitation of the core's API. `make -C firmware esp32` makes the
   folder of this sketch, with the modules that all boards share. */
extern "C" int diffbot_main(void);
void esp32_begin(void);

void setup()
{
    esp32_begin();
}

void loop()
{
    diffbot_main(); /* does not return; its waits are those of board_sleep */
}
