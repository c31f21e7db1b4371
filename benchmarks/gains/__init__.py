"""Whether the gains that palpate recommends are safe, against loops in MuJoCo and Drake."""
