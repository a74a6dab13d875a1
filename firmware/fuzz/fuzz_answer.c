/* libFuzzer: any bytes as a servo's answer, a remote's word, a frame; anything accepted is valid. */
#include <stdlib.h>

#include "../core/crc.h"
#include "../core/dynamixel.h"
#include "../core/frame.h"
#include "../core/remote.h"

static void answer(const uint8_t *data, size_t size) {
    uint8_t copy[300];
    if (size < 8u || size > 280u) return;
    memcpy(copy, data, size);
    uint32_t n = (uint32_t)size, count = n - DXL_OVERHEAD + (data[0] & 4u ? data[5] % 3u : 1u) - 1u; /* or one more or less was asked for */
    if (!(data[0] & 8u)) copy[0] = 0xFF;
    if (!(data[0] & 16u)) copy[1] = 0xFF;
    if (data[0] & 1u) copy[3] = (uint8_t)(count + 2u);
    if (data[0] & 2u) copy[n - 1u] = dxl_sum(copy, n);
    bool right = copy[0] == 0xFF && copy[1] == 0xFF && copy[2] == data[1] && copy[3] == count + 2u && n == count + DXL_OVERHEAD;
    if (dxl_status(copy, n, data[1], count) == DXL_OK && !(right && dxl_sum(copy, n) == copy[n - 1u])) abort();
}

static void frames(const uint8_t *data, size_t size) {
    static struct frame_reader r;
    static struct ring ring;
    memset(&r, 0, sizeof r);
    for (size_t k = 0; k < size; k++)
        if (frame_feed(&r, data[k])) {
            ring.in = ring.out = 0;
            if (!frame_send(&ring, r.type, r.number, r.payload, r.length)) abort();
            uint32_t n = ring_used(&ring);
            for (uint32_t i = 0; i < n; i++)
                if (ring_get(&ring) != data[k + 1u - n + i]) abort(); /* written again it is the same bytes */
        }
}

static void words(const uint8_t *data, size_t size) {
    struct remote r = {0};
    for (size_t k = 0; k < size; k++) {
        uint16_t pressed = remote_feed(&r, data[k], (uint32_t)(10u * k));
        bool whole = k >= 11u && data[k - 5u] == 0xFF && data[k - 4u] == 0x55 && (data[k] ^ data[k - 1u]) == 0xFF;
        if (pressed && !whole) abort(); /* only with a second whole word */
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    answer(data, size);
    frames(data, size);
    words(data, size);
    return 0;
}
