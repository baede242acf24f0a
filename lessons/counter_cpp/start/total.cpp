#include "diffbot_program.h"

int main() {
    static char line[DIFFBOT_LINE];
    double number;
    while (diffbot_read(line, sizeof line)) {
        if (diffbot_is(line, "number") && diffbot_number(line, "data", &number)) {
            diffbot_publish("{\"total\": {\"data\": %.17g}}", 0.0);
        }
    }
    return 0;
}
