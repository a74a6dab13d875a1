/* Every threshold of the firmware, with its unit and its reason. */
#ifndef LIMITS_H
#define LIMITS_H

#define MAX_JOINTS 26u        /* a Sync Write of goal and speed stays below the AX-12's receive buffer of 143 bytes */
#define TABLE_BYTES 4096u     /* 60 poses of 15 joints; two buffers fit into the 16 kB of RAM that the firmware allows itself */
#define SHORTEST_MS 10u       /* dwell: a Sync Write, its verification and a repair have to fit in */
#define LONGEST_MS 600000u
#define GOAL_LIMIT 1023u      /* largest goal position */
#define SPEED_LIMIT 1023u     /* largest moving speed in joint mode */
#define SPEED_MILLI 2271u     /* one count of moving speed, 0.111 rpm, in thousandths of a position count a second (AX-12A) */
#define FASTEST_SPEED 440u    /* what speed 0, "at once", amounts to: about 1000 counts a second at 11 V */

#define BUS_TIMEOUT_MS 3u     /* 0.1 ms request, 0.5 ms default return delay, 0.15 ms jitter, 0.56 ms for 56 bytes: 1.4 ms; tick 1 ms */
#define POSE_GUARD_MS 4u      /* no read is started so shortly before a pose: time-out and one tick */
#define SWEEP_MS 24u          /* all servos are read at least this often: 41.7 Hz */
#define TRIES 2u              /* of one read, before the servo counts as missed in this round */
#define CHECK_TRIES 5u        /* of one read before torque is switched on */
#define CHECK_SPREAD 6u       /* counts: two readings of a joint at rest agree within this before it gets torque */

#define BOOT_MS 2000u         /* after a reset servos may be starting themselves: an XC-330 takes 0.4 s, and none answers meanwhile */

#define LIMIT_SPREAD 2u       /* counts by which a servo's angle limits may be narrower than the table's bounds: rounding */

#define DEAD_ROUNDS 4u        /* rounds without an answer: about 100 ms, 300 ms are allowed; four by chance: 1e-12 at 0.1 % flips */
#define DEAD_MS 200u          /* or for so long, where many servos fail and rounds take longer */
#define FAILED_ROW 16u        /* reads that failed in a row, of whichever servos: 50 ms, before servos that restarted have started */
#define FLUSH_ROW 8u          /* failed reads in a row before FLUSH_BYTES go out, and are followed by as many questions before FAILED_ROW */
#define FLUSH_BYTES 128u      /* the most that one flipped bit adds to a length; servos take what follows for the rest of that packet */
#define SUPPLY_ROUNDS 2u      /* rounds that more than half of the servos missed: not a servo has died, but the supply */
#define ALARM_READINGS 3u     /* readings one after another that say the same before it is believed */
#define HOT_CELSIUS 65u       /* the servo itself gives up at 70 */
#define LOW_DECIVOLT 96u      /* 3.2 V a cell of the LiPo pack under load */
#define LOW_ROUNDS 36u        /* rounds in which most servos read low: 0.9 s, 2 s are allowed; a walk's sag is shorter */
#define DEAD_DECIVOLT 65u     /* below 6 V a servo is off; the supply has gone */
#define STRAY_BYTES 40u       /* bytes nobody asked for in a window; one late answer has at most 56, but no second follows */
#define STRAY_WINDOW_MS 25u
#define STRAY_WINDOWS 4u      /* windows one after another: somebody babbles */
#define RESENDS 6u            /* of one pose; a servo that does not take it then never will */

#define RAMP_SPEED 45u        /* 30 degrees a second: slow enough to step back from */
#define RAMP_SLOWEST 10u      /* 7 degrees a second: below, a servo sticks; 0 would mean at once */
#define RAMP_SPARE_MS 2000u   /* beyond the time that a ramp should take */
#define RAMP_TOLERANCE 30u    /* counts, 9 degrees: droop under the robot's own weight is 2 degrees */

#define SEAT_COUNTS 14        /* 4 degrees beyond neutral, the goal of a joint before it is let down onto its droop */
#define SEAT_MS 300u          /* for each of the two; friction lets go slowly */

#define RAMP_TORQUE 512u      /* half of full torque until neutral is reached for the first time: whatever is caught is not crushed */
#define IDLE_MS 300000u       /* held for so long without being used, torque goes: servos that hold get hot */

#define OFF_AGAIN_MS 12u      /* period of torque off, sent again to servos that may not have received it */
#define FRAME_MS 100u         /* a frame that stops for so long is over: a wrong length would swallow those that follow */

#define BUTTON_MS 20u         /* a button is pressed once it has been so for this long */
#define HELD_MS 1500u         /* START held this long releases at once */
#define REMOTE_MS 1000u       /* two equal words of the remote within this are one press */
#define UPLOAD_SILENCE_MS 2000u
#define BRIDGE_SILENCE_MS 1000u
#define BRIDGE_TIMEOUT_MS 5u

#endif
