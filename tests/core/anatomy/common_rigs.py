# SPDX-License-Identifier: Apache-2.0
"""Joints of the rigs that people have, as indented outlines, and which of them have a meaning."""

RIGS = {
    "Rigify, generated": (
        "MCH_torso_parent\n torso\n  MCH_spine_003\n   spine_fk_003\n    MCH_ROT_neck\n     neck\n      MCH_ROT_head\n"
        "       head\n    ORG_spine_003\n     ORG_shoulder_L\n      ORG_upper_arm_L\n     ORG_shoulder_R\n"
        "      ORG_upper_arm_R",
        {"head": "head", "neck": "neck", "upper_chest": "spine_fk_003", "left_upper_arm": "ORG_upper_arm_L"},
    ),
    "MotionBuilder": (
        "Hips\n LeftUpLeg\n RightUpLeg\n LowerBack\n  Spine1\n   Neck\n    Neck1\n     Head\n      HeadTop_End\n"
        "   LeftShoulder\n    LeftArm\n     LeftForeArm\n   RightShoulder\n    RightArm",
        {
            "head": "Head",
            "neck": "Neck",
            "upper_chest": "Spine1",
            "left_shoulder": "LeftShoulder",
            "left_upper_arm": "LeftArm",
            "left_lower_arm": "LeftForeArm",
            "hips": "Hips",
        },
    ),
    "3ds Max": (
        "Hips\n Chest\n  Chest2\n   LeftCollar\n    LeftShoulder\n     LeftElbow\n   RightCollar\n    RightShoulder\n"
        "   Neck\n    Head\n LeftHip\n RightHip",
        {"head": "Head", "upper_chest": "Chest2", "left_shoulder": "LeftCollar", "left_upper_arm": "LeftShoulder"},
    ),
    "Poser": (
        "hip\n abdomen\n  chest\n   neck\n    head\n     leftEye\n   rCollar\n    rShldr\n   lCollar\n    lShldr",
        {"head": "head", "neck": "neck", "upper_chest": "chest", "right_upper_arm": "rShldr", "left_eye": "leftEye"},
    ),
    "VRoid": (
        "J_Bip_C_Hips\n J_Bip_C_Spine\n  J_Bip_C_UpperChest\n   J_Bip_C_Neck\n    J_Bip_C_Head\n     J_Sec_Hair1\n"
        "   J_Bip_L_Shoulder\n    J_Bip_L_UpperArm\n   J_Bip_R_Shoulder\n    J_Bip_R_UpperArm",
        {"head": "J_Bip_C_Head", "upper_chest": "J_Bip_C_UpperChest", "right_upper_arm": "J_Bip_R_UpperArm"},
    ),
    "Unreal": (
        "pelvis\n spine_01\n  spine_03\n   clavicle_l\n    upperarm_l\n   clavicle_r\n    upperarm_r\n   neck_01\n    head",
        {"head": "head", "neck": "neck_01", "upper_chest": "spine_03", "left_shoulder": "clavicle_l"},
    ),
    "deforming bones alone, arms below the root": (
        "root\n pelvis\n  spine_01\n   spine_02\n    spine_03\n     neck_01\n      head\n clavicle_l\n  upperarm_l\n clavicle_r\n"
        "  upperarm_r",
        {"head": "head", "neck": "neck_01", "upper_chest": "spine_03", "left_upper_arm": "upperarm_l"},
    ),
    "Mixamo": (
        "mixamorig:Hips\n mixamorig:Spine2\n  mixamorig:Neck\n   mixamorig:Head\n    mixamorig:HeadTop_End\n"
        "  mixamorig:LeftShoulder\n   mixamorig:LeftArm\n  mixamorig:RightShoulder\n   mixamorig:RightArm",
        {"head": "mixamorig:Head", "left_upper_arm": "mixamorig:LeftArm", "upper_chest": "mixamorig:Spine2"},
    ),
    "HumanIK in a namespace, in USD": (
        "Root\n hero_rig_Character1_Hips\n  hero_rig_Character1_Spine\n   hero_rig_Character1_Spine1\n"
        "    hero_rig_Character1_Neck\n     hero_rig_Character1_Head\n    hero_rig_Character1_LeftShoulder\n"
        "     hero_rig_Character1_LeftArm\n      hero_rig_Character1_LeftForeArm\n       hero_rig_Character1_LeftHand\n"
        "    hero_rig_Character1_RightShoulder\n     hero_rig_Character1_RightArm",
        {
            "head": "hero_rig_Character1_Head",
            "left_shoulder": "hero_rig_Character1_LeftShoulder",
            "left_upper_arm": "hero_rig_Character1_LeftArm",
            "left_lower_arm": "hero_rig_Character1_LeftForeArm",
            "right_upper_arm": "hero_rig_Character1_RightArm",
            "upper_chest": "hero_rig_Character1_Spine1",
        },
    ),
    "a namespace, and joints of a face without it": (
        "Character1_Hips\n Character1_Spine\n  Character1_Neck\n   Character1_Head\n    jaw\n    eye_L\n    eye_R\n"
        "    tongue_1\n  Character1_LeftShoulder\n   Character1_LeftArm\n  Character1_RightShoulder\n"
        "   Character1_RightArm",
        {"head": "Character1_Head", "left_upper_arm": "Character1_LeftArm", "left_eye": "eye_L"},
    ),
    "a namespace, and more joints of hair without it": (
        "Character1_Hips\n Character1_Spine\n  Character1_Neck\n   Character1_Head\n"
        + "".join(f"    hair_{i:02d}\n" for i in range(9))
        + "  Character1_LeftShoulder\n   Character1_LeftArm\n  Character1_RightShoulder\n   Character1_RightArm",
        {"head": "Character1_Head", "left_upper_arm": "Character1_LeftArm"},
    ),
    "AutoRig Pro": (
        "root_x\n spine_01_x\n  spine_03_x\n   neck_x\n    head_x\n   shoulder_l\n    arm_stretch_l\n     forearm_stretch_l\n"
        "   shoulder_r\n    arm_stretch_r",
        {
            "head": "head_x",
            "neck": "neck_x",
            "left_shoulder": "shoulder_l",
            "left_upper_arm": "arm_stretch_l",
            "left_lower_arm": "forearm_stretch_l",
            "right_upper_arm": "arm_stretch_r",
        },
    ),
    "an avatar through glTF": (
        "Armature_rootJoint\n pelvis_Armature\n  chest_Armature\n   neck_Armature\n    head_Armature\n"
        "   shoulder_l_Armature\n    upper_arm_l_Armature\n   shoulder_r_Armature\n    upper_arm_r_Armature",
        {
            "head": "head_Armature",
            "left_shoulder": "shoulder_l_Armature",
            "left_upper_arm": "upper_arm_l_Armature",
            "right_upper_arm": "upper_arm_r_Armature",
            "upper_chest": "chest_Armature",
        },
    ),
    "Daz": (
        "hip\n abdomenLower\n  chestUpper\n   lCollar\n    lShldrBend\n     lShldrTwist\n      lForearmBend\n"
        "   rCollar\n    rShldrBend\n   neckLower\n    neckUpper\n     head",
        {
            "head": "head",
            "upper_chest": "chestUpper",
            "left_shoulder": "lCollar",
            "left_upper_arm": "lShldrBend",
            "left_lower_arm": "lForearmBend",
            "neck": "neckLower",
        },
    ),
    "Biped, collar bones on the neck": (
        "Bip001\n Bip001_Pelvis\n  Bip001_Spine\n   Bip001_Spine1\n    Bip001_Spine2\n     Bip001_Neck\n      Bip001_Head\n"
        "      Bip001_L_Clavicle\n       Bip001_L_UpperArm\n      Bip001_R_Clavicle\n       Bip001_R_UpperArm",
        {"neck": "Bip001_Neck", "upper_chest": "Bip001_Spine2", "head": "Bip001_Head"},
    ),
    "Rigify": (
        "DEF-spine\n DEF-spine.001\n  DEF-spine.002\n   DEF-spine.003\n    DEF-spine.004\n     DEF-spine.005\n"
        "      DEF-spine.006\n    DEF-shoulder.L\n     DEF-upper_arm.L\n    DEF-shoulder.R\n     DEF-upper_arm.R",
        {"head": "DEF-spine.006", "neck": "DEF-spine.004", "upper_chest": "DEF-spine.003"},
    ),
    "Rigify, a wolf's deforming bones": (
        "DEF_spine\n DEF_spine_001\n  DEF_spine_002\n   DEF_spine_003\nDEF_spine_004\n DEF_spine_005\n  DEF_spine_006\n"
        "   DEF_spine_010\n    DEF_spine_011",
        {"head": "DEF_spine_011"},
    ),
    "Maya, marked as binding": (
        "root_bind\n spine_bind\n  neck_bind\n   head_bind\n  L_clavicle_bind_JNT\n   L_bnd_upperArm\n    L_lowerArm_bnd\n"
        "  R_clavicle_skn\n   R_upperArm_env\n    R_lowerArm_drv",
        {
            "left_shoulder": "L_clavicle_bind_JNT",
            "left_upper_arm": "L_bnd_upperArm",
            "right_upper_arm": "R_upperArm_env",
            "right_lower_arm": "R_lowerArm_drv",
        },
    ),
    "XNALara": (
        "root_ground\n root_hips\n  spine_lower\n   spine_upper\n    head_neck_lower\n     head_neck_upper\n    arm_left_shoulder_1\n"
        "     arm_left_shoulder_2\n      arm_left_elbow\n  leg_left_thigh\n   leg_left_knee\n    leg_left_ankle",
        {
            "head": "head_neck_upper",
            "neck": "head_neck_lower",
            "left_upper_leg": "leg_left_thigh",
            "left_lower_leg": "leg_left_knee",
            "left_foot": "leg_left_ankle",
        },
    ),
    "AdvancedSkeleton": (
        "Root_M\n Spine1_M\n  Chest_M\n   Neck_M\n    Head_M\n   Scapula_L\n    Shoulder_L\n     Elbow_L\n   Scapula_R\n"
        "    Shoulder_R",
        {"left_shoulder": "Scapula_L", "left_upper_arm": "Shoulder_L", "left_lower_arm": "Elbow_L"},
    ),
    "mGear": (
        "spine_C0_pelvis_jnt\n spine_C0_01_jnt\n  neck_C0_0_jnt\n   neck_C0_head_jnt\n  shoulder_L0_shoulder_jnt\n"
        "   arm_L0_0_jnt\n    arm_L0_1_jnt\n     arm_L0_end_jnt\n  shoulder_R0_shoulder_jnt\n   arm_R0_0_jnt\n"
        " leg_L0_0_jnt\n  leg_L0_1_jnt\n   foot_L0_0_jnt\n leg_R0_0_jnt",
        {
            "head": "neck_C0_head_jnt",
            "left_shoulder": "shoulder_L0_shoulder_jnt",
            "left_upper_arm": "arm_L0_0_jnt",
            "left_lower_arm": "arm_L0_1_jnt",
            "left_hand": "arm_L0_end_jnt",
            "left_upper_leg": "leg_L0_0_jnt",
            "left_lower_leg": "leg_L0_1_jnt",
            "left_foot": "foot_L0_0_jnt",
        },
    ),
    "numbered along the limbs": (
        "root_jnt\n spine_01_jnt\n  neck_01_jnt\n   head_jnt\n  L_clavicle_jnt\n   L_arm_01_jnt\n    L_arm_twist_jnt\n"
        "    L_sleeve_jnt\n     L_sleeve_02_jnt\n      L_sleeve_03_jnt\n    L_arm_02_jnt\n     L_arm_03_jnt\n"
        " L_leg_01_jnt\n  L_leg_02_jnt\n   L_leg_03_jnt\n    L_leg_04_jnt",
        {
            "left_shoulder": "L_clavicle_jnt",
            "left_upper_arm": "L_arm_01_jnt",
            "left_lower_arm": "L_arm_02_jnt",
            "left_hand": "L_arm_03_jnt",
            "left_upper_leg": "L_leg_01_jnt",
            "left_lower_leg": "L_leg_02_jnt",
            "left_foot": "L_leg_03_jnt",
        },
    ),
    "an elbow of another name, below joints that part the upper arm": (
        "hips\n spine\n  neck\n   head\n  l_upperarm_01\n   l_upperarm_twist\n    l_upperarm_02\n     l_mid_arm\n      l_hand\n"
        "       l_finger",
        {"left_upper_arm": "l_upperarm_01", "left_lower_arm": "l_mid_arm", "left_hand": "l_hand"},
    ),
    "up and low behind the limb": (
        "hips\n spine\n  neck\n   head\n  l_shoulder\n   l_armUp\n    l_armLow\n l_legUp\n  l_legLow",
        {
            "left_shoulder": "l_shoulder",
            "left_upper_arm": "l_armUp",
            "left_lower_arm": "l_armLow",
            "left_upper_leg": "l_legUp",
            "left_lower_leg": "l_legLow",
        },
    ),
    "MikuMikuDance": (
        "センター\n 上半身\n  上半身2\n   首\n    頭\n     左目\n     左髪1\n   左肩\n    左腕\n     左ひじ\n      左手首\n"
        "   右肩\n    右腕\n     右ひじ\n 下半身\n  左足\n   左ひざ\n    左足首\n  右足",
        {
            "head": "頭",
            "neck": "首",
            "upper_chest": "上半身2",
            "left_shoulder": "左肩",
            "right_upper_arm": "右腕",
            "left_hand": "左手首",
            "left_upper_leg": "左足",
            "left_foot": "左足首",
            "left_eye": "左目",
        },
    ),
    "MikuMikuDance with controls in letters of full width": (
        "全ての親\n センター\n  上半身\n   首\n    頭\n   左肩Ｐ\n    左肩\n     左腕\n   右腕\n  下半身\n   左足\n    左ひざ\n"
        "     左足首\n   左足Ｄ\n    左ひざＤ\n   右足\n    右ひざ\n 左足ＩＫ\n 右足ＩＫ",
        {
            "hips": "センター",
            "left_shoulder": "左肩",
            "left_upper_leg": "左足",
            "left_lower_leg": "左ひざ",
            "right_upper_leg": "右足",
        },
    ),
    "controls that are called as the leg's own joints, nearer to the root": (
        "root\n thigh_l\n thigh_r\n pelvis\n  spine\n   neck\n    head\n  rig\n   thigh_l\n    calf_l\n     foot_l\n   thigh_r\n"
        "    calf_r",
        {"hips": "pelvis"},
    ),
    "SMPL, with feet below ankles and hands below wrists": (
        "Pelvis\n L_Hip\n  L_Knee\n   L_Ankle\n    L_Foot\n R_Hip\n Spine1\n  Neck\n   Head\n  L_Collar\n   L_Shoulder\n    L_Elbow\n"
        "     L_Wrist\n      L_Hand\n  R_Collar\n   R_Shoulder",
        {"left_lower_leg": "L_Knee", "left_foot": "L_Ankle", "left_lower_arm": "L_Elbow", "left_hand": "L_Wrist"},
    ),
    "ankles and wrists that are parts of feet and hands": (
        "pelvis\n thigh_l\n  calf_l\n   foot_l\n    ankle_l\n thigh_r\n spine\n  neck\n   head\n  clavicle_l\n   upperarm_l\n"
        "    lowerarm_l\n     hand_l\n     wrist_l\n  upperarm_r",
        {"left_foot": "foot_l", "left_hand": "hand_l"},
    ),
    "MikuMikuDance in English": (
        "center\n upper_body\n  neck\n   head\n  arm_L\n   elbow_L\n  arm_R\n lower_body\n  leg_L\n   knee_L\n    ankle_L\n  leg_R",
        {"left_upper_leg": "leg_L", "left_lower_leg": "knee_L", "left_foot": "ankle_L", "left_lower_arm": "elbow_L"},
    ),
    "Motive": (
        "Hip\n Ab\n  Chest\n   Neck\n    Head\n   LShoulder\n    LUArm\n     LFArm\n      LHand\n   RShoulder\n    RUArm\n"
        "     RFArm\n LThigh\n  LShin\n RThigh",
        {
            "upper_chest": "Chest",
            "left_shoulder": "LShoulder",
            "left_upper_arm": "LUArm",
            "left_lower_arm": "LFArm",
            "left_hand": "LHand",
            "right_upper_arm": "RUArm",
        },
    ),
    "a bicep between shoulder and elbow": (
        "hips\n chest\n  neck\n   head\n  l_shoulder\n   l_bicep\n    l_bicep_twist\n     l_elbow\n      l_wrist\n  r_shoulder",
        {
            "left_shoulder": "l_shoulder",
            "left_upper_arm": "l_bicep",
            "left_lower_arm": "l_elbow",
            "left_hand": "l_wrist",
        },
    ),
    "a shoulder that is the arm, in parts": (
        "hips\n chest\n  neck\n   head\n  Shoulder_L\n   ShoulderPart1_L\n    Twist_L\n     Elbow_L\n  Shoulder_R\n   Elbow_R",
        {"left_upper_arm": "Shoulder_L", "left_lower_arm": "Elbow_L", "right_upper_arm": "Shoulder_R"},
    ),
    "3ds Max CAT": (
        "CATRigPelvis\n CATRigSpine1\n  CATRigRibcage\n   CATRigNeck1\n    CATRigHead\n   CATRigLArmCollarbone\n    CATRigLArm1\n"
        "     CATRigLArm2\n      CATRigLArmPalm\n   CATRigRArmCollarbone\n    CATRigRArm1",
        {"left_shoulder": "CATRigLArmCollarbone", "left_upper_arm": "CATRigLArm1", "left_lower_arm": "CATRigLArm2"},
    ),
}
